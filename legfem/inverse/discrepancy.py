"""The model's discrepancy: a smooth error of no known form, of several sizes and lengths.

It stands for what no mechanism describes, and beside a mechanism for what that leaves: no real effect has exactly the
form of a model. It is alike in all trials of a protocol, or each trial's own. A Gaussian process, after M. C. Kennedy,
A. O'Hagan, J. R. Stat. Soc. B 63 (2001) 425.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from legfem.common.units import FloatArray
from legfem.data.segmentation import HOLD
from legfem.inverse.errors import ErrorModel
from legfem.inverse.observations import Observations


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """An error of the model that has no name: smooth, of some size and length.

    Parameters
    ----------
    covariance
        (n, n), N^2; None for no such error.
    size
        Its standard deviation over the largest force.
    log_prior
        Logarithm of its share among all of them, that of none included.
    """

    covariance: FloatArray | None
    size: float
    log_prior: float


SIZES = (0.002, 0.006, 0.02, 0.06)
"""Standard deviations over the largest force."""
LENGTHS = (0.12, 0.4)
"""Over the greatest depth; of a hold's logarithm of time likewise."""
_LEAST = 0.15
"""Of the size at first touch, over that at the largest force."""


def possible_discrepancies(observed: Observations, force: FloatArray) -> list[Discrepancy]:
    """Return the errors that are possible, none first.

    Parameters
    ----------
    observed
        The recordings.
    force
        (n,), N: that the base model predicts.
    """
    along = _along(observed)
    largest = float(np.abs(force).max())
    envelope = _LEAST + (1 - _LEAST) * np.abs(force) / largest
    same_segment = np.equal.outer(observed.segment, observed.segment)
    same_programme = np.equal.outer(observed.protocol, observed.protocol)
    same_trial = np.equal.outer(observed.trial, observed.trial)
    found = [Discrepancy(None, 0.0, 0.0)]
    share = -float(np.log(len(SIZES) * len(LENGTHS) * 2))
    for length in LENGTHS:
        apart = np.subtract.outer(along, along) / length
        shape = np.exp(-0.5 * apart**2) * same_segment * same_programme
        for kernel in (shape, shape * same_trial):
            scaled = kernel * np.outer(envelope, envelope)
            found += [Discrepancy((size * largest) ** 2 * scaled, size, share) for size in SIZES]
    return found


def _along(observed: Observations) -> FloatArray:
    """Return where observations stand along their segments (n,): depth, or logarithm of time."""
    along = observed.displacement / observed.depth
    for stations, number in zip(observed.protocols, range(len(observed.protocols)), strict=True):
        held = (observed.phase == HOLD) & (observed.protocol == number)
        start = np.array(stations.protocol.time)[observed.segment[held]]
        along[held] = np.log(np.maximum(observed.time[held] - start, 1e-3)) / 6.0
    return np.asarray(along)


def with_discrepancy(errors: ErrorModel, unknown: Discrepancy) -> ErrorModel:
    """Return the errors with an error of unknown shape among them."""
    if unknown.covariance is None:
        return errors
    return replace(errors, dense=errors.dense + unknown.covariance)

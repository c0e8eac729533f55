"""Errors of the model that have no name: smooth, of several sizes and lengths.

They stand for what no mechanism describes, and beside a mechanism for what its form leaves: no real
effect has exactly the form of a model. They are alike in all trials of a programme, or each trial's
own.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from legfem.common.units import FloatArray
from legfem.data.segmentation import HOLD
from legfem.diagnose.observations import Observations
from legfem.inverse.errors import ErrorModel
from legfem.inverse.evidence import Discrepancy

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

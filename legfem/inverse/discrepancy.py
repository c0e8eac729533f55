"""The model's discrepancy: a smooth error of no known form, of several sizes and lengths.

It stands for what no mechanism describes, and beside a mechanism for what that leaves: no real effect has exactly the
form of a model. It is alike in all trials of a protocol, or each trial's own. A Gaussian process, after M. C. Kennedy,
A. O'Hagan, J. R. Stat. Soc. B 63 (2001) 425.
"""

from dataclasses import dataclass, replace

import numpy as np

from legfem.common.units import FloatArray
from legfem.data.phases import HOLD
from legfem.inverse.errors import ErrorModel
from legfem.inverse.observations import Observations


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """An error of the model that has no name: smooth, of some size and length.

    Parameters
    ----------
    covariance
        (N, N), in the readings' units; None for no such error.
    size
        Its standard deviation over the scale of the channels that it is in; see `discrepancy_scales`.
    log_prior
        Logarithm of its share among all of them, that of none included.
    by_channel
        Its size in each channel, the force first: nothing where it isn't.
    """

    covariance: FloatArray | None
    size: float
    log_prior: float
    by_channel: tuple[float, ...] = ()


SIZES = (0.002, 0.006, 0.02, 0.06)
"""Standard deviations over the largest force, and over the greatest displacement of a length."""
LENGTHS = (0.12, 0.4)
"""Over the greatest depth; of a hold's logarithm of time likewise."""
_LEAST = 0.15
"""Of the size at first touch, over that at the largest force."""


def discrepancy_scales(observed: Observations, prediction: FloatArray) -> tuple[float, ...]:
    """Return what sizes are over in each channel: the largest force, or the greatest displacement.

    Parameters
    ----------
    observed
        The recordings.
    prediction
        (N,): of the base model.
    """
    largest = float(np.abs(prediction[: len(observed.force)]).max())
    lengths = dict.fromkeys((one.name for one in observed.channels), observed.depth)
    for one, span in zip(observed.channels, observed.data.spans[1:], strict=True):
        if one.follows_force:
            # A pressure's own size; another force is small beside that along the travel.
            lengths[one.name] = largest if one.is_force else float(np.abs(prediction[span]).max())
    return largest, *lengths.values()


def possible_discrepancies(observed: Observations, prediction: FloatArray) -> list[Discrepancy]:
    """Return the errors that are possible, none first.

    What is unknown may be in all channels, in the force alone, or in all but the force; from channel to channel it is
    independent.

    Parameters
    ----------
    observed
        The recordings.
    prediction
        (N,): of the base model.
    """
    at, spans = observed.nearest, observed.data.spans
    along = np.concatenate([_along(observed), *(one.weights @ _along(observed) for one in observed.channels)])
    scales = discrepancy_scales(observed, prediction)
    force = prediction[: len(observed.force)]
    loads = np.concatenate([np.abs(force), observed.displacement[at[len(force) :]]])
    greatest = np.repeat([scales[0], observed.depth], [len(force), len(loads) - len(force)])
    envelope = _LEAST + (1 - _LEAST) * loads / greatest
    channel = np.repeat(np.arange(len(spans)), [span.stop - span.start for span in spans])
    same_channel = np.equal.outer(channel, channel)
    same_segment = np.equal.outer(observed.segment[at], observed.segment[at])
    same_programme = np.equal.outer(observed.protocol[at], observed.protocol[at])
    same_trial = np.equal.outer(observed.trial[at], observed.trial[at])
    ways = [np.ones(len(spans))]
    if observed.channels:
        in_force = np.eye(len(spans))[0]
        ways += [in_force, 1 - in_force]
    found = [Discrepancy(None, 0.0, 0.0, (0.0,) * len(spans))]
    share = -float(np.log(len(SIZES) * len(LENGTHS) * 2 * len(ways)))
    for where in ways:
        scale = (where * scales)[channel]
        for length in LENGTHS:
            apart = np.subtract.outer(along, along) / length
            shape = np.exp(-0.5 * apart**2) * same_segment * same_programme * same_channel
            for kernel in (shape, shape * same_trial):
                scaled = kernel * np.outer(envelope, envelope)
                found += [
                    Discrepancy(np.outer(size * scale, size * scale) * scaled, size, share, tuple(size * where))
                    for size in SIZES
                ]
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

"""What readings of further channels than the force err by, block by block.

Each channel has an instrument of its own: errors from reading to reading, slow ones, those of its clock in every trial
(a lag, times the reading's rate), and one boundary and one gain that all its trials share. None of them is the load
cell's; what isn't known of the leg (outlines, aim, stiffness of the fat) is shared with the force.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from legfem.channels.registry import FILE_OF
from legfem.common.units import FloatArray
from legfem.data.noise import contrasts_of
from legfem.inverse.channel_readings import ChannelReadings

_MODEL_SHARE, _MODEL_LENGTH_MM = 0.01, 5.0
"""Of the model's own error, smooth along the displacement: over what the channel changes by. Meshes twice as fine
change thicknesses by 0.007 mm at most, the skin's rise by 0.04 mm and the lateral force by 0.2 %."""
_OWN = 0.05
"""Of a reading's variance: what no neighbour shares."""
_SHAPE_LENGTH_MM = 10.0
"""Of what outlines that are off, and two effects at once, do beyond the sum of their single effects
(`ChannelKind.model_share`): with skin and fascia 1 mm off, an aim of 1 mm and bones of 0.5 to 1.4 mm, 0.15 mm of the
skin's rise at 20 mm; fat 2.7 and fascia 12 times as stiff, 0.12 mm at 10 mm; 0.03 mm of thickness each."""


def reading_covariance(
    one: ChannelReadings, slope: FloatArray, slowest: float, repeated: Sequence[Sequence[int]]
) -> FloatArray:
    """Return the covariance (k, k) of the instrument's errors that aren't alike in all readings, in its unit squared.

    Parameters
    ----------
    one
        The readings.
    slope
        (k,), of the channel by the displacement, in its unit per mm.
    slowest
        Time (s) over which slow errors are correlated.
    repeated
        Numbers of the trials by programme.
    """
    same = np.equal.outer(one.trial, one.trial)
    alike = one.alike(one.accuracy.apart)
    slow = one.accuracy.slow**2 * np.exp(-np.abs(np.subtract.outer(one.time, one.time)) / slowest) * alike
    lag = one.accuracy.lag * slope * one.speed
    own = _white(one, alike) + same * (slow + np.outer(lag, lag))
    return np.asarray(_excess_of_repeats(one, own, repeated) * own)


def _white(one: ChannelReadings, alike: FloatArray) -> FloatArray:
    """Return the covariance (k, k) of errors from frame to frame, which places near each other share."""
    if one.course is None:
        return np.diag(one.white_variance)
    sd = np.sqrt(one.white_variance)
    return np.asarray(np.outer(sd, sd) * alike * np.equal.outer(one.frame, one.frame) + np.diag(_OWN * sd**2))


def model_covariance(one: ChannelReadings, change: float) -> FloatArray:
    """Return the covariance (k, k) of the model's own error; ``change`` is what it changes by, in its unit."""
    apart = np.subtract.outer(one.displacement, one.displacement)
    of_meshes = (_MODEL_SHARE * change) ** 2 * np.exp(-0.5 * (apart / _MODEL_LENGTH_MM) ** 2)
    deeper = one.kind.model_share * one.displacement
    total = of_meshes + np.outer(deeper, deeper) * np.exp(-0.5 * (apart / _SHAPE_LENGTH_MM) ** 2)
    return np.asarray(total * one.alike(_SHAPE_LENGTH_MM))


def _excess_of_repeats(one: ChannelReadings, own: FloatArray, repeated: Sequence[Sequence[int]]) -> float:
    """Return the factor on a channel's variance by which repeats differ by more than stated; one where they don't.

    Of contrasts between trials of a programme, which don't hold the true course: their squares over the stated
    variance, in the mean.
    """
    squares, count = 0.0, 0
    for members in repeated:
        rows = [np.flatnonzero(one.trial == k) for k in members]
        if len(rows) < 2 or not len(rows[0]) or len({len(row) for row in rows}) > 1:
            continue
        contrasts = contrasts_of(one.values[np.array(rows)])
        each = own[np.ix_(rows[0], rows[0])]
        squares += float(np.sum(contrasts * np.linalg.solve(each, contrasts)))
        count += contrasts.size
    return max(1.0, squares / count) if count else 1.0


def shared_errors(one: ChannelReadings, predicted: FloatArray, force: FloatArray) -> dict[str, FloatArray]:
    """Return by name what one standard deviation of an error does that all of a channel's readings share (k,).

    Parameters
    ----------
    one
        The readings.
    predicted
        (k,), by the model, or smoothed.
    force
        (k,), N, along the travel: a cell that reads several forces mixes them by as much as its gains are off.
    """
    alike = "zero" if one.kind.follows_force else "boundary"
    found: dict[str, FloatArray] = {alike: one.accuracy.bias * np.ones(len(predicted))}
    if one.accuracy.gain > 0:
        found["gain"] = one.accuracy.gain * (predicted - one.kind.at_rest)
        if one.kind.is_force:
            found["cross-talk"] = one.accuracy.gain * force
    return {f"{one.kind.title}: {name}": effect for name, effect in found.items()}


def errors_of_places(one: ChannelReadings, predicted: FloatArray) -> dict[str, FloatArray]:
    """Return by name what one standard deviation does of what readings at several places share, (k,)."""
    if one.course is None:
        return {}
    found = FILE_OF[one.name].shared(one.place, one.time, one.frame, predicted, one.accuracy)
    return {f"{one.kind.title}: {name}": effect for name, effect in found.items()}


def misplaced_covariance(one: ChannelReadings, effects: Mapping[str, FloatArray]) -> FloatArray:
    """Return the covariance (k, k) of what `errors_of_places` are off by: at each place alone, alike in all frames."""
    if one.course is None or not effects:
        return np.zeros((len(one.values), len(one.values)))
    each = np.array(list(effects.values()))
    off = FILE_OF[one.name].shared_is_off(one.place)
    return np.asarray(off**2 * np.equal.outer(one.course, one.course) * (each.T @ each))

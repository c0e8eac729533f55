"""What readings of further channels than the force err by, block by block.

Each channel has an instrument of its own: errors from reading to reading, slow ones, those of its clock in every trial
(a lag, times the reading's rate), and one boundary and one gain that all its trials share. None of them is the load
cell's; what isn't known of the leg (outlines, aim, stiffness of the fat) is shared with the force.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial

from legfem.common.units import FloatArray
from legfem.data.noise import contrasts_of
from legfem.inverse.channel_readings import ChannelReadings
from legfem.inverse.trial_noise import Observed

MODEL_SHARE, MODEL_LENGTH_MM = 0.01, 5.0
"""Of the model's own error, smooth along the displacement: over what the channel changes by."""
_DEGREE = 3


def channel_covariance(one: ChannelReadings, observed: Observed, predicted: FloatArray, slowest: float) -> FloatArray:
    """Return the covariance (k, k) of a channel's errors that aren't alike in all its readings, in its unit squared.

    Parameters
    ----------
    one
        The channel.
    observed
        The recordings.
    predicted
        (k,), by the model.
    slowest
        Time (s) over which slow errors are correlated.
    """
    displacement, time = one.weights @ observed.displacement, one.weights @ observed.time
    trial = observed.trial[one.nearest]
    same = np.equal.outer(trial, trial)
    slow = one.accuracy.slow**2 * np.exp(-np.abs(np.subtract.outer(time, time)) / slowest)
    lag = one.accuracy.lag * _slope(displacement, predicted) * (one.weights @ observed.speed)
    own = np.diag(one.white_variance) + same * (slow + np.outer(lag, lag))
    apart = np.subtract.outer(displacement, displacement) / MODEL_LENGTH_MM
    model = (MODEL_SHARE * float(np.ptp(predicted))) ** 2 * np.exp(-0.5 * apart**2)
    return np.asarray(_excess_of_repeats(one, observed, own) * own + model)


def _excess_of_repeats(one: ChannelReadings, observed: Observed, own: FloatArray) -> float:
    """Return the factor on a channel's variance by which repeats differ by more than stated; one where they don't.

    Of contrasts between trials of a programme, which don't hold the true course: their squares over the stated
    variance, in the mean.
    """
    trial = observed.trial[one.nearest]
    squares, count = 0.0, 0
    for members in observed.repeated:
        rows = [np.flatnonzero(trial == k) for k in members]
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
        The channel.
    predicted
        (k,), by the model.
    force
        (n,), N, at the stations: a cell that reads several forces mixes them by as much as its gains are off.
    """
    found = {"zero" if one.is_force else "boundary": one.accuracy.bias * np.ones(len(predicted))}
    if one.accuracy.gain > 0:
        found["gain"] = one.accuracy.gain * predicted
        if one.is_force:
            found["cross-talk"] = one.accuracy.gain * (one.weights @ force)
    return {f"{one.kind.name.replace('_', ' ')}: {name}": effect for name, effect in found.items()}


def _slope(displacement: FloatArray, predicted: FloatArray) -> FloatArray:
    """Return the derivative (k,) of a channel by the displacement, over all its readings."""
    degree = min(_DEGREE, len(np.unique(np.round(displacement, 1))) - 1)
    if degree < 1:
        return np.zeros(len(displacement))
    return np.asarray(Polynomial.fit(displacement, predicted, degree).deriv()(displacement))

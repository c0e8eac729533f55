r"""Mean and covariance of a normal distribution between bounds.

Each bound's effect is taken up by a normal factor with the truncated distribution's own moments,
one parameter after the other until nothing changes (expectation propagation). J. P. Cunningham,
P. Hennig, S. Lacoste-Julien, Gaussian probabilities and expectation propagation (2011),
arXiv:1111.6832.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import truncnorm

from legfem.common.units import FloatArray

_ROUNDS, _CLOSE = 30, 1e-6
_INSIDE = 6.0
"""Standard deviations from which a bound cuts nothing off."""
_FAR = 20.0
"""Standard deviations beyond which a tail is exponential."""
_FLATTEST = 1e-10
"""Least precision of a factor: where a bound cuts next to nothing, rounding may make it less."""


def within(
    mean: FloatArray, covariance: FloatArray, low: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the moments of a normal distribution within bounds.

    Parameters
    ----------
    mean, covariance
        (p,) and (p, p): without the bounds.
    low, high
        (p,): between which values are possible; infinite where there is no end.
    """
    at, spread = mean.copy(), covariance.copy()
    precision, shift = np.zeros(len(mean)), np.zeros(len(mean))
    sd = np.sqrt(np.diag(covariance))
    cut = np.flatnonzero((low > mean - _INSIDE * sd) | (high < mean + _INSIDE * sd))
    for _ in range(_ROUNDS):
        before = at.copy()
        for k in cut:
            # By rounding: the bounds leave nothing else to know.
            if spread[k, k] <= 0.0 or spread[k, k] * precision[k] >= 1.0:
                continue
            without = 1.0 / (1.0 / spread[k, k] - precision[k])
            middle = without * (at[k] / spread[k, k] - shift[k])
            inside, variance = _truncated(middle, without, low[k], high[k])
            more = max(1.0 / variance - 1.0 / without, _FLATTEST) - precision[k]
            pull = inside / variance - middle / without - shift[k]
            column = spread[:, k] / (1.0 + more * spread[k, k])
            at = at + column * (pull - more * at[k])
            spread = spread - more * np.outer(column, spread[:, k])
            precision[k] += more
            shift[k] += pull
        if np.all(np.abs(at - before) <= _CLOSE * sd):
            break
    return at, spread


def _truncated(mean: float, variance: float, low: float, high: float) -> tuple[float, float]:
    """Return the mean and variance of one normal variable between two ends."""
    sd = float(np.sqrt(variance))
    first, last = (low - mean) / sd, (high - mean) / sd
    if last < -_FAR:
        inside, spread = _truncated(0.0, 1.0, -last, -first)
        return mean - sd * inside, variance * spread
    if first > _FAR:
        # The density falls exponentially there.
        away = min(1.0 / first, 0.5 * (last - first))
        return mean + sd * (first + away), variance * away**2
    own = truncnorm(first, last)
    return mean + sd * float(own.mean()), variance * float(own.var())

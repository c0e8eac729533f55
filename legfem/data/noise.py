"""Errors of readings: as instruments state them, and as repeats of one trial show them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import LinAlgError, cholesky, helmert, solve_triangular
from scipy.optimize import minimize

from legfem.common.units import FloatArray
from legfem.data.recording import Recording
from legfem.data.smoothing import sample_noise

EXPECTED_GAIN_SD = 0.01
"""Standard deviation of the gain between repeats on one site, before they are compared."""
WANDER_LENGTH_MM = 5.0
"""Way over which a displacement sensor's slow error changes."""
JITTER_LENGTH_MM = 0.5
"""Way over which smoothed displacement errs alike: half of what it is smoothed over."""
_LEAST_SLOW = 0.12
"""Least share of a load cell's variance that is slow, however much jitter is seen."""
_LEAST_WANDER = 0.04
"""Least share of a displacement sensor's variance that is slow, however much jitter is seen."""


@dataclass(frozen=True)
class Instrument:
    """Standard deviations of a single reading.

    A stated accuracy (plus or minus a) is read as a uniform distribution, hence a standard
    deviation of a / sqrt(3); see `legfem.legs.subject`.
    """

    force_sd: float
    """N."""
    displacement_sd: float
    """mm."""
    stated: bool = True
    """Whether a data sheet says so; else seen in the recordings, see `seen_instrument`."""

    def slow_force_sd(self, white_sd: float) -> float:
        """Return the load cell's slow error, N: what of its accuracy isn't seen as white noise."""
        whole = self.force_sd**2
        return float(np.sqrt(max(whole - white_sd**2, _LEAST_SLOW * whole)))

    def wander_sd(self, jitter_sd: float) -> float:
        """Return the displacement sensor's slow error, mm, likewise."""
        whole = self.displacement_sd**2
        return float(np.sqrt(max(whole - jitter_sd**2, _LEAST_WANDER * whole)))


UNSTATED = Instrument(0.0, 0.0, stated=False)
"""An instrument of which nothing is known: the recording's scatter counts."""


def seen_instrument(recordings: Sequence[Recording]) -> Instrument:
    """Return the errors that recordings show from sample to sample, where none are stated.

    What is slow or the same in all trials isn't seen: these are lower bounds. At least a hundredth
    of a newton and of a millimetre.
    """
    force = [sample_noise(r.force) ** 2 for r in recordings]
    displacement = [sample_noise(r.displacement) ** 2 + r.step**2 / 12 for r in recordings]
    force_sd, way_sd = (max(0.01, float(np.sqrt(np.mean(one or [0.0])))) for one in (force, displacement))
    return Instrument(force_sd, way_sd, stated=False)


_FACTOR = 5.0
"""Natural logarithm of how far sizes may lie from what is expected, either way."""
_IMPOSSIBLE = 1e12


@dataclass(frozen=True, eq=False)
class Differences:
    """Differences between the repeats of one programme."""

    contrasts: FloatArray
    """(m, R - 1), N: orthonormal contrasts between R trials; see `contrasts_of`."""
    covariance: Callable[[FloatArray], FloatArray]
    """Covariance of one trial's values, (m, m), N^2, by the sizes (k,)."""


def contrasts_of(values: FloatArray) -> FloatArray:
    """Return (n, R - 1): what R trials (R, n) differ by; the true curve isn't in it.

    Helmert's contrasts are orthonormal: each has the covariance of one trial.
    """
    return np.asarray((helmert(len(values)) @ values).T)


def sizes_from_repeats(expected: FloatArray, vagueness: ArrayLike, differences: Sequence[Differences]) -> FloatArray:
    """Return the sizes (k,) that maximise the differences' likelihood times what is expected.

    Expectations are log-normal: they keep two or three repeats that happen to agree from claiming
    certainty.

    Parameters
    ----------
    expected
        (k,): medians of what is expected.
    vagueness
        Their log-standard deviations, (k,) or one for all.
    differences
        Differences of each programme that was repeated.
    """

    def cost(logs: FloatArray) -> float:
        total = 0.5 * float(np.sum((logs / np.asarray(vagueness)) ** 2))
        for one in differences:
            try:
                lower = cholesky(one.covariance(expected * np.exp(logs)), lower=True)
            except LinAlgError:
                return _IMPOSSIBLE
            white = solve_triangular(lower, one.contrasts, lower=True)
            log_det = 2 * float(np.sum(np.log(np.diag(lower))))
            total += 0.5 * (one.contrasts.shape[1] * log_det + float(np.sum(white**2)))
        return total

    found = minimize(cost, np.zeros(len(expected)), method="L-BFGS-B", bounds=[(-_FACTOR, _FACTOR)] * len(expected))
    return np.asarray(expected * np.exp(found.x))


_SLOW_WAYS = (0.5, 5.0)
"""Over which a load cell's slow error changes: as flicker noise, half of its variance over each."""


def slow_correlation(places: FloatArray) -> FloatArray:
    """Return the correlation (n, n) of a load cell's slow error between places (n,) of a press, over its length."""
    apart = np.abs(places[:, None] - places[None, :])
    return np.asarray(np.mean([np.exp(-apart / way) for way in _SLOW_WAYS], axis=0))


_SLOWEST_OF_TEST, _SLOWEST_MM = 0.02, 5.0


def slowest_error(speed: float, duration: float) -> float:
    """Return the time (s) over which an instrument's slow error is expected to be correlated.

    Parameters
    ----------
    speed
        Greatest speed of the loading, mm/s.
    duration
        Duration of the longest trial, s.
    """
    return max(_SLOWEST_MM / speed, _SLOWEST_OF_TEST * duration)

"""Errors of readings: as instruments state them, and as repeats of one trial show them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import LinAlgError, cholesky, helmert, solve_triangular
from scipy.optimize import minimize
from scipy.special import ndtri, stdtrit

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
    displacement = [sample_noise(r.displacement) ** 2 for r in recordings]
    return Instrument(
        max(0.01, float(np.sqrt(np.mean(force or [0.0])))),
        max(0.01, float(np.sqrt(np.mean(displacement or [0.0])))),
        stated=False,
    )


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

    bounds = [(-_FACTOR, _FACTOR)] * len(expected)
    found = minimize(cost, np.zeros(len(expected)), method="L-BFGS-B", bounds=bounds)
    return np.asarray(expected * np.exp(found.x))


_SLOW_WAYS = (0.5, 5.0)
"""Over which a load cell's slow error changes: as flicker noise, half of its variance over each."""


def slow_correlation(places: FloatArray) -> FloatArray:
    """Return the correlation (n, n) of a load cell's slow error between places (n,) of a press, over its length."""
    apart = np.abs(places[:, None] - places[None, :])
    return np.asarray(np.mean([np.exp(-apart / way) for way in _SLOW_WAYS], axis=0))


ANY_LEVEL = 100.0
"""Standard deviation, in slow errors, that leaves a level open."""
ANY_PLACE_MM = 1.0
"""Standard deviation that leaves first contact open."""
_VAGUENESS = 1.0
"""Log-standard deviation of what is expected of each component before looking at the repeats."""
_EXPECTED_LENGTH_MM = 1.0
"""Correlation length of slow errors that is expected."""


@dataclass(frozen=True)
class NoiseEstimate:
    """Components of one trial's error about the true curve.

    A trial reads F + offset + gain F + shift dF/dd + slow + white, each independent between
    trials; after air the trials are aligned and an error of their common shift is added.
    Errors that all trials share (a load cell's calibration) aren't seen in repeats and aren't
    in here.
    """

    force_sd: float
    """Standard deviation of one reading about the trial's true curve (slow and white), N."""
    white_sd: float
    """Sample-to-sample part, N."""
    slow_sd: float
    """Part that changes slowly, see `slow_correlation`, N."""
    correlation_length: float
    """mm of displacement; the slow part changes over `slow_ways`."""
    offset_sd: float
    """N."""
    gain_sd: float
    """Dimensionless."""
    shift_sd: float
    """mm: between trials, in where first contact is put."""
    common_shift_sd: float
    """mm: of first contact in the mean curve, where it was found after air; else 0."""
    repeat_dof: int
    """Trials less one: degrees of freedom behind the components that repeats reveal."""
    source: str
    """``repeats and instrument``, or ``instrument`` for a single trial."""

    def trial_covariance(self, displacement: FloatArray, force: FloatArray, slope: FloatArray) -> FloatArray:
        """Return the covariance (n, n), N^2, of one trial's curve without its white part."""
        few = self.small_sample_factor
        sizes = few * self.offset_sd, few * self.gain_sd, few * self.shift_sd, self.slow_sd, self.correlation_length
        return _covariance(np.array(sizes), displacement, force, slope)

    @property
    def slow_ways(self) -> tuple[float, ...]:
        """Ways over which each half of the slow part changes, mm."""
        return tuple(way * self.correlation_length for way in _SLOW_WAYS)

    @property
    def small_sample_factor(self) -> float:
        """Student's over the normal 97.5 % quantile, for the components that differ by trial.

        A few repeats tell their standard deviations poorly. The expectation counts as two more
        degrees of freedom; a single trial has nothing but it, and is taken at its word.
        """
        if self.repeat_dof < 1:
            return 1.0
        return float(stdtrit(self.repeat_dof + 2, 0.975) / ndtri(0.975))


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


@dataclass(frozen=True)
class Expectation:
    """What instruments and contact fits say before the repeats are compared."""

    offset_sd: float
    """N."""
    shift_sd: float
    """mm, between trials."""
    common_shift_sd: float
    """mm, of the mean curve."""
    slow_sd: float
    """N."""
    white_sd: float
    """N."""
    placed: bool = False
    """Whether trials were brought onto each other: their differences then show no offset and no shift, and nothing of
    a slow error that looks like these."""


def estimate_components(
    displacement: FloatArray,
    curves: FloatArray,
    force: FloatArray,
    slope: FloatArray,
    known_variance: FloatArray,
    expected: Expectation,
) -> NoiseEstimate:
    """Estimate the components of the trials' errors from their differences, see `repeats`.

    Parameters
    ----------
    displacement : (n,) array
        The grid, mm.
    curves : (R, n) array
        The trials' forces on it, N.
    force, slope : (n,) array
        Force and slope of the mean curve, N and N/mm, without its noise.
    known_variance : (n,) array
        Variance of a trial's grid values that comes from white noise, N^2.
    expected : Expectation
        Scales expected of the components.
    """
    repeats = len(curves)
    centre = np.array([expected.offset_sd, EXPECTED_GAIN_SD, expected.shift_sd, expected.slow_sd, _EXPECTED_LENGTH_MM])
    found = centre.copy()
    if repeats > 1:
        ridge = np.diag(known_variance + 1e-12 * float(np.max(force**2)))
        open_to = np.array([1, 3, 4]) if expected.placed else np.arange(5)
        anywhere = np.array([ANY_LEVEL * expected.slow_sd, 0.0, ANY_PLACE_MM, 0.0, 0.0])

        def covariance(sizes: FloatArray) -> FloatArray:
            every = anywhere.copy()
            every[open_to] = sizes
            return _covariance(every, displacement, force, slope) + ridge

        found[open_to] = sizes_from_repeats(
            centre[open_to], _VAGUENESS, [Differences(contrasts_of(curves), covariance)]
        )
    offset, gain, shift, slow, length = (float(v) for v in found)
    return NoiseEstimate(
        force_sd=float(np.hypot(slow, expected.white_sd)),
        white_sd=expected.white_sd,
        slow_sd=slow,
        correlation_length=length,
        offset_sd=offset,
        gain_sd=gain,
        shift_sd=shift,
        common_shift_sd=expected.common_shift_sd,
        repeat_dof=repeats - 1,
        source="repeats and instrument" if repeats > 1 else "instrument",
    )


def _covariance(components: FloatArray, displacement: FloatArray, force: FloatArray, slope: FloatArray) -> FloatArray:
    offset, gain, shift, slow, length = components
    total: FloatArray = (
        offset**2
        + gain**2 * np.outer(force, force)
        + shift**2 * np.outer(slope, slope)
        + slow**2 * slow_correlation(displacement / length)
    )
    return total

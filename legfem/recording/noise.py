"""How uncertain the mean of repeated loading curves is, and over what distance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri, stdtrit

from legfem.common.units import FloatArray
from legfem.recording.instrument import EXPECTED_GAIN_SD
from legfem.recording.repeats import Differences, contrasts_of, sizes_from_repeats

# Log-standard deviation of what is expected of each component before looking at the repeats.
_VAGUENESS = 1.0
_EXPECTED_LENGTH_MM = 1.0


@dataclass(frozen=True)
class NoiseEstimate:
    """Components of one trial's error about the true curve.

    A trial reads F + offset + gain F + shift dF/dd + slow + white, each independent between
    trials; after air the trials are aligned and an error of their common shift is added.
    Errors that all trials share (a load cell's calibration) aren't seen in repeats and aren't
    in here.
    """

    force_sd: float
    """Of one reading about its own trial's true curve (slow and white), N."""
    white_sd: float
    """Sample-to-sample part, N."""
    slow_sd: float
    """Part correlated over ``correlation_length``, N."""
    correlation_length: float
    """mm of displacement over which the slow part's correlation falls to 1/e."""
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
        return _covariance(
            np.array(
                [few * self.offset_sd, few * self.gain_sd, few * self.shift_sd, self.slow_sd, self.correlation_length]
            ),
            displacement,
            force,
            slope,
        )

    @property
    def small_sample_factor(self) -> float:
        """Student's over the normal 97.5 % quantile, for the components that differ by trial.

        A few repeats tell their standard deviations poorly. The expectation counts as two more
        degrees of freedom; a single trial has nothing but it, and is taken at its word.
        """
        if self.repeat_dof < 1:
            return 1.0
        return float(stdtrit(self.repeat_dof + 2, 0.975) / ndtri(0.975))


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


def estimate_noise(
    displacement: FloatArray, curves: FloatArray, slope: FloatArray, known_variance: FloatArray, expected: Expectation
) -> NoiseEstimate:
    """Estimate the components of the trials' errors from their differences, see `repeats`.

    Parameters
    ----------
    displacement : (n,) array
        The grid, mm.
    curves : (R, n) array
        The trials' forces on it, N.
    slope : (n,) array
        dF/dd of the mean curve, N/mm.
    known_variance : (n,) array
        Variance of a trial's grid values that comes from white noise, N^2.
    expected : Expectation
        Scales expected of the components.
    """
    repeats = len(curves)
    centre = np.array([expected.offset_sd, EXPECTED_GAIN_SD, expected.shift_sd, expected.slow_sd, _EXPECTED_LENGTH_MM])
    found = centre
    if repeats > 1:
        mean = curves.mean(axis=0)
        ridge = np.diag(known_variance + 1e-12 * float(np.max(mean**2)))
        differences = Differences(
            contrasts_of(curves), lambda sizes: _covariance(sizes, displacement, mean, slope) + ridge
        )
        found = sizes_from_repeats(centre, _VAGUENESS, [differences])
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
    apart = np.abs(displacement[:, None] - displacement[None, :])
    total: FloatArray = (
        offset**2
        + gain**2 * np.outer(force, force)
        + shift**2 * np.outer(slope, slope)
        + slow**2 * np.exp(-apart / length)
    )
    return total

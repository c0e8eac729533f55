"""How large a trial's own errors are: from its repeats and the instruments' figures.

White, slow in the load cell (correlated over time), slow in the displacement sensor (over the way);
`legfem.inverse.errors` has what else recordings and predictions err by.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from legfem.common.units import FloatArray
from legfem.data.noise import (
    JITTER_LENGTH_MM,
    WANDER_LENGTH_MM,
    Differences,
    Instrument,
    contrasts_of,
    sizes_from_repeats,
)
from legfem.inverse.observations import Observations

CORNER_MM = 5.0
"""Way that counts as walked between two phases: there the drive stops and turns, time passes, and
the sensor's error is no longer that of a moment ago."""
MOST_FORCE, MOST_WAY = 2.5, 4.0
"""Of what is stated of a load cell's and of a displacement sensor's slow error: the most that is
noise, ..."""
AT_REST_FORCE, AT_REST_MM = 0.01, 0.05
"""... but for what is noise whatever was stated: a leg is never quite at rest. Of the greatest
force, and mm."""
USUAL_AT_REST = 0.5 * AT_REST_FORCE
"""The same of a living leg where no repeats show how quiet it was."""
_VAGUENESS, _STATED = 1.0, 0.3
"""Log-standard deviations of what is expected before looking at the repeats, and of a figure that
the data sheet states: the repeats tell a slow error's size over its time well, each of them ill."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations of a trial's errors."""

    white_sd: float
    """Of one reading, N: the mean over trials."""
    slow_sd: float
    """Standard deviation of the load cell's slow error, N."""
    correlation_time: float
    """s over which the slow error's correlation falls to 1/e."""
    zero_sd: float
    """Expected of a trial's zero, N."""
    wander_sd: float
    """Standard deviation of the displacement sensor's slow error, mm."""
    source: str
    """What the sizes are known from."""
    beyond_force: float = 0.0
    beyond_way: float = 0.0
    """Slow differences between repeats (N, mm) that are more than instruments of the stated
    accuracy make: what is beyond it isn't taken for noise. Else 0."""

    @property
    def force_sd(self) -> float:
        """Of one reading about its own trial's course, N."""
        return float(np.hypot(self.white_sd, self.slow_sd))


def estimate_noise(
    observed: Observations, instrument: Instrument, residual: FloatArray | None = None, at_rest: float = 0.0
) -> Noise:
    """Estimate the sizes of a trial's errors from repeats and instruments.

    Contrasts between repeats don't hold the true curve. What differs from trial to trial otherwise
    (a zero, a gain, a shift, a drift) is projected out of them first.

    Parameters
    ----------
    observed
        The recordings.
    instrument
        Stated accuracy: what of the load cell's isn't white noise is a slow error.
    residual
        (n,), N: of a fitted model, whose misfit is alike in all trials but whose first contacts
        are each trial's own; the recorded force without it.
    at_rest
        Least slow error, over the greatest force, where no repeats tell of it.
    """
    white = observed.white_sd
    figures = "the instrument's stated accuracy" if instrument.stated else "differences from sample to sample"
    few = f"{figures} only (there are no repeats)"
    expected = Noise(
        white_sd=white,
        slow_sd=instrument.slow_force_sd(white),
        correlation_time=observed.slowest,
        zero_sd=max(instrument.force_sd, 1e-3 * float(np.abs(observed.force).max())),
        wander_sd=instrument.wander_sd(observed.jitter_sd),
        source=few if observed.repeats < 2 else f"the repeats and {figures}",
    )
    greatest = float(np.abs(observed.force).max())
    if observed.repeats < 2:
        # Neither a data sheet nor repeats tell of slow errors: load cells' are about as large.
        seen = expected.slow_sd if instrument.stated else white
        return replace(expected, slow_sd=max(seen, at_rest * greatest))
    vague = np.array([_STATED if instrument.stated else _VAGUENESS, _VAGUENESS, _VAGUENESS])
    values = observed.force if residual is None else residual
    found = _from_repeats(observed, expected, values, vague)
    return _as_stated(found, expected, greatest, observed.way) if instrument.stated else found


def _as_stated(found: Noise, expected: Noise, greatest: float, unit: float) -> Noise:
    """Return the noise as far as instruments of the stated accuracy and a leg at rest make it."""
    force = max(MOST_FORCE * expected.slow_sd, AT_REST_FORCE * greatest)
    way = max(MOST_WAY * expected.wander_sd, AT_REST_MM * unit)
    return replace(
        found,
        slow_sd=min(found.slow_sd, force),
        wander_sd=min(found.wander_sd, way),
        beyond_force=found.slow_sd if found.slow_sd > force else 0.0,
        beyond_way=found.wander_sd if found.wander_sd > way else 0.0,
    )


def trial_covariance(observed: Observations, noise: Noise) -> FloatArray:
    """Return the covariance (n, n), N^2, of the trials' noise about their own courses."""
    result = np.zeros((len(observed.force),) * 2)
    for k in range(int(observed.trial.max()) + 1):
        here = np.flatnonzero(observed.trial == k)
        result[np.ix_(here, here)] = _one_trial(observed, noise, here)
    return result


def _one_trial(observed: Observations, noise: Noise, here: NDArray[np.int_]) -> FloatArray:
    time, slope = observed.time[here], observed.stiffness[here]
    steps = np.abs(np.diff(observed.displacement[here]))
    corners = np.diff(observed.segment[here]) != 0
    walked = np.concatenate([[0.0], np.cumsum(steps / observed.way + CORNER_MM * corners)])
    apart_s = np.abs(time[:, None] - time[None, :])
    apart_mm = np.abs(walked[:, None] - walked[None, :])
    both = np.outer(slope, slope)
    jitter = np.sqrt(observed.jitter_variance[here])
    result: FloatArray = (
        np.diag(observed.white_variance[here])
        + noise.slow_sd**2 * np.exp(-apart_s / noise.correlation_time)
        + noise.wander_sd**2 * both * np.exp(-apart_mm / WANDER_LENGTH_MM)
        + both * np.outer(jitter, jitter) * np.exp(-apart_mm / JITTER_LENGTH_MM)
    )
    return result


def _from_repeats(observed: Observations, expected: Noise, values: FloatArray, vague: FloatArray) -> Noise:
    def noise_at(sizes: FloatArray) -> Noise:
        slow, length, wander = (float(size) for size in sizes)
        return replace(expected, slow_sd=slow, correlation_time=length, wander_sd=wander)

    every = map(observed.stations_of, range(len(observed.protocols)))
    differences = [_differences(observed, rows, values, noise_at) for rows in every if len(rows) > 1]
    centre = np.array([expected.slow_sd, expected.correlation_time, expected.wander_sd])
    return noise_at(sizes_from_repeats(centre, vague, differences))


def _differences(
    observed: Observations, rows: NDArray[np.int_], values: FloatArray, noise_at: Callable[[FloatArray], Noise]
) -> Differences:
    """Return what repeats differ by, whose stations (trials, m) are in rows, without smooth changes."""
    here, mean = rows[0], observed.force[rows].mean(axis=0)
    slope = observed.stiffness[here]
    changes = np.column_stack([np.ones(len(here)), mean, mean**2, slope, np.gradient(slope), observed.time[here]])
    basis = np.linalg.qr(changes, mode="complete")[0][:, changes.shape[1] :]
    return Differences(
        basis.T @ contrasts_of(values[rows]),
        lambda sizes: basis.T @ _one_trial(observed, noise_at(sizes), here) @ basis,
    )

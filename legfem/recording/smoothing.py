"""Local straight-line regression and the noise of a single sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from legfem.common.units import FloatArray


@dataclass(frozen=True, eq=False)
class LocalLine:
    """Straight lines fitted around each point; all arrays are (m,)."""

    value: FloatArray
    slope: FloatArray
    leverage: FloatArray
    """Variance of ``value`` over that of one sample."""
    count: FloatArray
    """Samples in the window."""


def local_line(
    x: FloatArray, y: FloatArray, at: FloatArray, half_width: float, min_points: int = 4
) -> LocalLine:
    """Fit a straight line to the samples within ``half_width`` of each point.

    Parameters
    ----------
    x, y : (n,) array
        Samples, x not decreasing.
    at : (m,) array
        Where to evaluate.
    half_width : float
        In x's unit; the window widens to the nearest ``min_points`` samples where there are
        fewer.
    min_points : int
        At least 2.

    Raises
    ------
    ValueError
        If there are fewer than ``min_points`` samples.
    """
    n = len(x)
    if n < min_points:
        raise ValueError(f"{n} samples are fewer than {min_points}")
    low = np.searchsorted(x, at - half_width, side="left")
    high = np.searchsorted(x, at + half_width, side="right")
    short = high - low < min_points
    if short.any():
        near = np.searchsorted(x, at[short]) - min_points // 2
        low[short] = np.clip(near, 0, n - min_points)
        high[short] = low[short] + min_points
    # Moments from cumulative sums, about the data's middle so that nothing cancels.
    x0, y0, scale = float(np.mean(x)), float(np.mean(y)), float(np.ptp(x)) or 1.0
    u, w = (x - x0) / scale, y - y0

    def window_sum(values: FloatArray) -> FloatArray:
        total = np.concatenate([[0.0], np.cumsum(values)])
        return np.asarray(total[high] - total[low])

    count = (high - low).astype(np.float64)
    mean_u, mean_w = window_sum(u) / count, window_sum(w) / count
    spread = window_sum(u * u) - count * mean_u**2
    slanted = spread > 1e-12 * count
    safe = np.where(slanted, spread, 1.0)
    slope = np.where(slanted, (window_sum(u * w) - count * mean_u * mean_w) / safe, 0.0)
    lever = (at - x0) / scale - mean_u
    return LocalLine(
        value=y0 + mean_w + slope * lever,
        slope=slope / scale,
        leverage=1.0 / count + np.where(slanted, lever**2 / safe, 0.0),
        count=count,
    )


def sample_noise(values: FloatArray) -> float:
    """Return the standard deviation of the sample-to-sample (white) noise of a smooth signal.

    From second differences, by the median of their size, so that corners and outliers don't
    count.
    """
    if len(values) < 3:
        return 0.0
    second = np.diff(values, 2) / np.sqrt(6.0)
    return float(1.4826 * np.median(np.abs(second - np.median(second))))


def typical_speed(time: FloatArray, displacement: FloatArray) -> float:
    """Return the speed of the moving phases, mm/s: the 90th percentile over coarse windows."""
    half = 0.025 * float(time[-1] - time[0])
    fit = local_line(time, displacement, time, half, min(7, len(time)))
    return float(np.percentile(np.abs(fit.slope), 90.0))


def velocity_window(time: FloatArray, displacement: FloatArray, accuracy: float = 0.05) -> float:
    """Return the half-width in s over which a fitted velocity is known to ``accuracy`` of it."""
    step = float(np.median(np.diff(time)))
    travel = typical_speed(time, displacement) * step
    noise = sample_noise(displacement)
    wanted = 0.0 if travel <= 0 else (12.0 * (noise / (accuracy * travel)) ** 2) ** (1 / 3)
    samples = float(np.clip(wanted, 5.0, max(5.0, len(time) / 8)))
    return 0.5 * samples * step


def smooth_displacement(
    time: FloatArray, displacement: FloatArray, travel: float = 1.0
) -> tuple[FloatArray, FloatArray]:
    """Smooth a displacement over time, which is known far better than the sensor reads.

    The motion is smooth and the clock good, so a straight line over about ``travel`` mm of
    motion removes the sensor's noise. Regressing force on the noisy readings would flatten the
    curve (errors in variables).

    Returns
    -------
    smooth, leverage : (n,) array
        mm, and its variance over that of one reading.
    """
    speed = typical_speed(time, displacement)
    half = 0.5 * travel / speed if speed > 0 else 0.0
    fit = local_line(time, displacement, time, half, min(5, len(time)))
    return fit.value, fit.leverage

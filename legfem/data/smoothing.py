"""Local straight-line regression and the noise of a single sample."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from shapely import LineString

from legfem.common.units import FloatArray

_MAX_POINTS = 8000
STILL = 0.15
"""Share of the typical speed below which the indenter counts as still."""


@dataclass(frozen=True, eq=False)
class LocalLine:
    """Straight lines fitted around each point; all arrays are (m,)."""

    value: FloatArray
    slope: FloatArray
    leverage: FloatArray
    """Variance of ``value`` over that of one sample."""


def local_line(
    x: FloatArray, y: FloatArray, at: FloatArray, half_width: float | FloatArray, min_points: int = 4
) -> LocalLine:
    """Fit a straight line to the samples within ``half_width`` of each point.

    Parameters
    ----------
    x, y : (n,) array
        Samples, x not decreasing.
    at : (m,) array
        Where to evaluate.
    half_width : float or (m,) array
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
    leverage = 1.0 / count + np.where(slanted, lever**2 / safe, 0.0)
    return LocalLine(value=y0 + mean_w + slope * lever, slope=slope / scale, leverage=leverage)


def sample_noise(values: FloatArray) -> float:
    """Return the standard deviation of the sample-to-sample (white) noise of a smooth signal.

    From second differences, by the median of their size, so that corners and outliers don't
    count.
    """
    if len(values) < 3:
        return 0.0
    second = np.diff(values, 2) / np.sqrt(6.0)
    return float(1.4826 * np.median(np.abs(second - np.median(second))))


_COARSE, _RESTS = 0.01, 3.0
"""Share of the way that a coarse counter's step is at least; times its neighbours that a rest on a step lasts."""
_FEWEST_STEPS, _STANDS = 4, 2
"""Steps, and samples of one reading, that a coarse counter has at least."""


def between_steps(time: FloatArray, displacement: FloatArray) -> tuple[FloatArray, float]:
    """Return the way (n,) of a coarse counter, which stands still between its steps, and the step; 0 of any other's.

    It is half a step on where the counter changes, and on a step where the drive rests.
    """
    at = np.flatnonzero(np.diff(displacement))
    sizes = np.abs(np.diff(displacement)[at])
    step = float(sizes.min(initial=np.inf))
    whole = bool(np.allclose(sizes / step, np.round(sizes / step), atol=0.05))
    coarse = len(at) >= _FEWEST_STEPS and whole and step > _COARSE * np.ptp(displacement)
    passed = np.diff(np.sign(np.diff(displacement)[at])) == 0
    if not coarse or not passed.any() or np.median(np.diff(at)[passed]) < _STANDS:
        return displacement, 0.0
    when, middle = 0.5 * (time[at] + time[at + 1]), 0.5 * (displacement[at] + displacement[at + 1])
    usual = np.median(np.diff(when)[passed])
    # A noisy one goes to and fro before it stays: as if once, in the middle of that.
    first = np.flatnonzero(np.append(True, (np.diff(middle) != 0) | (np.diff(when) > usual)))
    last = np.append(first[1:], len(at)) - 1
    when = np.add.reduceat(when, first) / (last - first + 1)
    before, after = np.append(np.inf, np.diff(when)), np.append(np.diff(when), np.inf)
    rests, begins = after > _RESTS * np.maximum(before, usual), before > _RESTS * np.maximum(after, usual)
    places = np.concatenate([when, (when + 0.5 * before)[rests], (when - 0.5 * after)[begins]])
    values = np.concatenate([middle[first], displacement[at[last] + 1][rests], displacement[at[first]][begins]])
    order = np.argsort(places)
    return np.interp(time, places[order], values[order]), step


def without_outliers(values: FloatArray) -> FloatArray:
    """Return a motion whose single readings far off are replaced by their neighbours' middle."""
    middle = median_filter(values, 3, mode="nearest")
    off = np.abs(values - middle)
    return np.where(off > 5.0 * sample_noise(values) + 0.02 * float(np.ptp(middle)), middle, values)


def _stretches(time: FloatArray, displacement: FloatArray) -> FloatArray:
    """Return the corners (k, 2), s and mm, of the straight line that follows a motion.

    By Douglas' and Peucker's simplification, within five standard deviations of a reading and half
    a hundredth of the way; a single reading far off doesn't count. How long the recording lasts
    beside its motion doesn't matter.
    """
    steady = without_outliers(displacement)
    within = max(5.0 * sample_noise(displacement), 0.005 * float(np.ptp(steady)), 1e-12)
    kept = np.r_[0 : len(time) - 1 : -(-len(time) // _MAX_POINTS), len(time) - 1]
    # Time is stretched until what lies perpendicular to the line is displacement.
    stretch = 1e4 * float(np.ptp(steady) + within) / float(np.min(np.diff(time)))
    at = (time[kept] - time[0]) * stretch
    corners = np.asarray(LineString(np.column_stack([at, steady[kept]])).simplify(within).coords)
    return np.column_stack([corners[:, 0] / stretch + time[0], corners[:, 1]])


def pace(time: FloatArray, displacement: FloatArray) -> tuple[float, FloatArray]:
    """Return how fast an indenter moves, mm/s: typically, and (n,) in the straight stretch that a sample lies in.

    Typical is the 90th percentile over coarse windows of the moving stretches, however long the holds are. Moving is
    what is no slower than 0.15 times the speed at which, or above which, half of the way is gone. A coarse window spans
    half of such a stretch at most.
    """
    corners = _stretches(time, displacement)
    taken, way = np.abs(np.diff(corners, axis=0).T)
    speed = way / taken
    order = np.argsort(speed)
    gone = np.cumsum(way[order])
    least = STILL * speed[order[np.searchsorted(gone, 0.5 * gone[-1])]]
    weight = np.where(speed >= least, way + 1e-12, 0.0)
    half = min(0.025 * float(time[-1] - time[0]), 0.25 * float(np.average(taken, weights=weight)))
    local = speed[np.searchsorted(corners[1:-1, 0], time, side="right")]
    fit = local_line(time, displacement, time[local >= least], half, min(7, len(time)))
    return float(np.percentile(np.abs(fit.slope), 90.0)), local


def velocity_window(time: FloatArray, displacement: FloatArray, speed: float) -> float:
    """Return the half-width in s over which a velocity (mm/s) is known to 5 % of it."""
    step = float(np.median(np.diff(time)))
    noise = sample_noise(displacement)
    wanted = 0.0 if speed <= 0 else (12.0 * (noise / (0.05 * speed * step)) ** 2) ** (1 / 3)
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
    typical, local = pace(time, displacement)
    # A fast stretch beside slow ones isn't smoothed away.
    speed = np.where(local > 2.0 * typical, local, typical)
    half = 0.5 * travel / speed if typical > 0 else 0.0
    fit = local_line(time, without_outliers(displacement), time, half, min(5, len(time)))
    return fit.value, fit.leverage

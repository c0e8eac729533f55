"""The phases of a recording by its motion alone, with the corners between them; and where what is pulled tears."""

import numpy as np
from numpy.typing import NDArray

from legfem.common.units import FloatArray, runs_of
from legfem.data.smoothing import STILL, local_line, pace, sample_noise, velocity_window, without_outliers

LOADING, HOLD, UNLOADING, AIR = "loading", "hold", "unloading", "air"
_TORN = 0.25
"""Share of the force that no whole specimen loses as it is pulled or pressed on: intact ones lose up to 0.14."""
_OF_NOISE = 8.0
"""Standard deviations of a reading that a fall is at least, and what it falls from: a press begins within its noise."""
_HELD_SHARE = 0.05
"""Share of the recording's way below which a still stretch is a hold, whatever its speed."""


def phases_of_motion(time: FloatArray, displacement: FloatArray, unit: float) -> NDArray[np.str_]:
    """Return every sample's phase (n,): ``loading``, ``hold`` or ``unloading``.

    The velocity, from straight lines over a window wide enough for the sensor's noise, gives the phases; their corners
    are then fitted.

    Parameters
    ----------
    time, displacement : (n,) array
        s, and mm without outliers.
    unit : float
        Way of `legfem.data.contact.Scales`, mm.
    """
    held = max(_HELD_SHARE * float(np.ptp(displacement)), 5.0 * sample_noise(displacement))
    return np.array([UNLOADING, HOLD, LOADING])[_motion(time, displacement, held, unit) + 1].astype("<U9")


def _motion(t: FloatArray, d: FloatArray, held: float, unit: float) -> NDArray[np.int_]:
    """Return -1, 0 and 1 (n,) for unloading, still and loading.

    What is still beside faster motion, but goes further than ``held`` mm, is looked at by itself:
    a slow motion beside a fast one.
    """
    speed, _ = pace(t, d)
    half = velocity_window(t, d, speed)
    window = max(3, round(2 * half / float(np.median(np.diff(t)))))
    still = STILL * speed
    velocity = local_line(t, d, t, half, min(5, len(t))).slope
    motion = np.where(np.abs(velocity) <= still, 0, np.sign(velocity)).astype(int)
    for start, end in runs_of(motion):
        if end - start < max(2, window // 2) and start > 0:
            motion[start:end] = motion[start - 1]
    motion = _fitted_corners(t, d, motion, window)
    runs = runs_of(motion)
    least = least_way(d, unit)
    for (before, _), (start, end), (after, _) in zip(runs, runs[1:], runs[2:], strict=False):
        if motion[before] == motion[after] == 0 and abs(d[end - 1] - d[start]) < least:
            motion[start:end] = 0
    for start, end in runs_of(motion):
        few = max(1, (end - start) // 10)
        way = float(np.median(d[end - few : end]) - np.median(d[start : start + few]))
        if motion[start] == 0 and abs(way) > held:
            part = slice(start, end)
            whole = end - start == len(t)
            motion[part] = np.sign(way) if whole else _motion(t[part], d[part], held, unit)
    return motion


def before_tear(time: FloatArray, displacement: FloatArray, force: FloatArray) -> int:
    """Return how many of n samples come before the force falls by a quarter while the drive goes on as before.

    Where it relaxes as much, the drive rests, or is slower than it was. All n where nothing tears.
    """
    d, change = np.maximum.accumulate(displacement), without_outliers(force) - np.median(force[:3])
    top = np.maximum.accumulate(np.abs(change))
    last = np.maximum.accumulate(np.where(np.abs(change) == top, np.arange(len(d)), 0))
    # Of all before: what falls may go farther than what rose.
    top, last = np.append(0.0, top[:-1]), np.append(0, last[:-1])
    noise = sample_noise(force)
    fallen = top - change * np.sign(change[last]) > np.maximum(_TORN * top, _OF_NOISE * noise)
    half = np.searchsorted(d, d[0] + 0.5 * (d[last] - d[0]))
    as_fast = (displacement - d[last]) * (time[last] - time[half]) > 0.25 * (d[last] - d[0]) * (time - time[last])
    torn = fallen & as_fast & (top > max(_OF_NOISE * noise, 0.1 * float(np.ptp(change))))
    return int(last[np.argmax(torn)]) + 1 if torn.any() else len(d)


def least_way(displacement: FloatArray, way: float) -> float:
    """Return the way (mm) below which motion between two holds is noise, with that of `Scales`."""
    return max(0.3 * way, 0.02 * float(np.ptp(displacement)))


def _fitted_corners(t: FloatArray, d: FloatArray, motion: NDArray[np.int_], window: int) -> NDArray[np.int_]:
    motion = motion.copy()
    corners = np.flatnonzero(np.diff(motion)) + 1
    bounds = [0, *(int(c) for c in corners), len(t)]
    for k, corner in enumerate(corners):
        low = max(corner - 2 * window, bounds[k])
        high = min(corner + 2 * window, bounds[k + 2])
        if corner - low < 3 or high - corner < 3:
            continue
        before, after = motion[corner - 1], motion[corner]
        best = _corner(t[low:high], d[low:high]) + low
        motion[low:best], motion[best:high] = before, after
    return motion


def _corner(t: FloatArray, d: FloatArray) -> int:
    """Return the sample at which two straight lines that meet there fit best."""
    inner = np.arange(2, len(t) - 1)
    bent = (t[None, :] - t[inner, None]) / (t[-1] - t[0])
    design = np.stack([np.ones_like(bent), np.minimum(bent, 0), np.maximum(bent, 0)], axis=-1)
    left = d - d.mean()
    across = np.swapaxes(design, 1, 2)
    lines = np.linalg.solve(across @ design, (across @ left)[..., None])
    # What the lines explain of the squares; the rest is smallest where this is largest.
    return int(inner[np.argmax(np.sum(lines[..., 0] * (across @ left), axis=1))])

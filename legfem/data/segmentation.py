"""Loading, hold, unloading and air."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from legfem.common.units import FloatArray
from legfem.data.contact import Contact, find_first_contact, fit_onset
from legfem.data.recording import Recording
from legfem.data.smoothing import (
    STILL,
    local_line,
    pace,
    sample_noise,
    smooth_displacement,
    velocity_window,
    without_outliers,
)

LOADING, HOLD, UNLOADING, AIR = "loading", "hold", "unloading", "air"
# A still stretch of less way than this share of the recording's holds whatever its speed.
_HELD_SHARE = 0.05


def split_phases(recording: Recording, contact: Contact | None = None) -> NDArray[np.str_]:
    """Label every sample ``loading``, ``hold``, ``unloading`` or ``air``.

    Parameters
    ----------
    recording : Recording
        The trial.
    contact : Contact, optional
        Its first contact; found if not given.

    Returns
    -------
    (n,) array of str
        The velocity, from straight lines over a window wide enough for the sensor's noise,
        gives the phases; their corners are then fitted. Before first contact, and after the
        force has come back to its baseline, the cylinder is in air.
    """
    contact = find_first_contact(recording) if contact is None else contact
    t, d = recording.time, without_outliers(recording.displacement)
    motion = _motion(t, d, max(_HELD_SHARE * float(np.ptp(d)), 5.0 * sample_noise(d)))
    labels = np.array([UNLOADING, HOLD, LOADING])[motion + 1].astype("<U9")
    smooth, _ = smooth_displacement(t, d)
    touched = np.flatnonzero(smooth >= contact.displacement)
    if contact.in_air:
        labels[: touched[0] if len(touched) else len(labels)] = AIR
    _mark_separation(recording, labels, smooth, contact)
    return labels


def _motion(t: FloatArray, d: FloatArray, held: float) -> NDArray[np.int_]:
    """Return -1, 0 and 1 (n,) for unloading, still and loading.

    What is still beside faster motion, but goes further than ``held`` mm, is looked at by itself:
    a slow motion beside a fast one.
    """
    speed = pace(t, d).typical
    half = velocity_window(t, d, speed)
    window = max(3, round(2 * half / float(np.median(np.diff(t)))))
    still = STILL * speed
    velocity = local_line(t, d, t, half, min(5, len(t))).slope
    motion = np.where(np.abs(velocity) <= still, 0, np.sign(velocity)).astype(int)
    motion = _without_blips(motion, max(2, window // 2))
    motion = _fitted_corners(t, d, motion, window)
    runs = _runs(motion)
    least = least_way(d)
    for (before, _), (start, end), (after, _) in zip(runs, runs[1:], runs[2:], strict=False):
        if motion[before] == motion[after] == 0 and abs(d[end - 1] - d[start]) < least:
            motion[start:end] = 0
    for start, end in _runs(motion):
        few = max(1, (end - start) // 10)
        way = float(np.median(d[end - few : end]) - np.median(d[start : start + few]))
        if motion[start] == 0 and abs(way) > held:
            part = slice(start, end)
            whole = end - start == len(t)
            motion[part] = np.sign(way) if whole else _motion(t[part], d[part], held)
    return motion


def least_way(displacement: FloatArray) -> float:
    """Return the way (mm) below which motion between two holds is noise."""
    return max(0.3, 0.02 * float(np.ptp(displacement)))


def _runs(marks: NDArray[np.generic]) -> list[tuple[int, int]]:
    """Return the first number and the one after the last of each run of equal marks."""
    edges = [0, *(int(k) + 1 for k in np.flatnonzero(marks[1:] != marks[:-1])), len(marks)]
    return list(pairwise(edges))


def _without_blips(motion: NDArray[np.int_], shortest: int) -> NDArray[np.int_]:
    motion = motion.copy()
    for start, end in _runs(motion):
        if end - start < shortest and start > 0:
            motion[start:end] = motion[start - 1]
    return motion


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


def _mark_separation(recording: Recording, labels: NDArray[np.str_], smooth: FloatArray, contact: Contact) -> None:
    """Call air what follows the force's return to a constant, until the skin is pressed again.

    Unloading is read backwards for it. Where the first loading met no force there either, first
    contact isn't where it is said to be, and all that follows is called air.
    """
    runs = _runs(labels)
    for k, (start, end) in enumerate(runs):
        if labels[start] != UNLOADING or LOADING not in labels[:start] or end - start < 20:
            continue
        start = max(start, start + int(np.argmax(recording.displacement[start:end])) + 1)
        part = slice(start, end)
        smooth_part, _ = smooth_displacement(recording.time[part], recording.displacement[part])
        onset = fit_onset(smooth_part[::-1], recording.force[part][::-1], 0.0, sample_noise(recording.displacement))
        left = start + np.flatnonzero(smooth_part < onset.displacement)
        if not onset.in_air or len(left) == 0:
            continue
        if _in_vain(recording, labels, smooth, contact, onset):
            labels[left[0] :] = AIR
            return
        # The way back to the start, in air, is no press.
        pressed = onset.displacement + 0.05 * (float(smooth.max()) - contact.displacement)
        again = next((a for a, b in runs[k + 1 :] if labels[a] == LOADING and smooth[a:b].max() > pressed), len(labels))
        labels[left[0] : again] = AIR
        deeper = np.flatnonzero(smooth[again:] >= contact.displacement)
        labels[again : again + deeper[0] if len(deeper) else len(labels)] = AIR


def _in_vain(
    recording: Recording, labels: NDArray[np.str_], smooth: FloatArray, contact: Contact, left: Contact
) -> bool:
    """Tell whether the first loading met no force on the way from contact to where skin was left.

    Of less than a tenth of the depth nothing can be told.
    """
    loading = np.flatnonzero(labels == LOADING)
    depth = float(smooth.max()) - contact.displacement
    if left.displacement - contact.displacement < 0.1 * depth:
        return False
    first = loading[: np.argmax(smooth[loading] >= left.displacement)]
    few = max(3, len(first) // 5)
    if len(first) < 2 * few:
        return False
    rise = float(np.median(recording.force[first[-few:]]) - np.median(recording.force[first[:few]]))
    whole = float(np.ptp(recording.force))
    return rise < max(3.0 * sample_noise(recording.force), 0.005 * whole)

"""Loading, hold, unloading and air."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from legfem.common.units import FloatArray
from legfem.recording.contact import Contact, find_first_contact, fit_onset
from legfem.recording.smoothing import (
    local_line,
    sample_noise,
    smooth_displacement,
    typical_speed,
    velocity_window,
)
from legfem.recording.trial import Recording

LOADING, HOLD, UNLOADING, AIR = "loading", "hold", "unloading", "air"
# Fraction of the typical speed below which the cylinder counts as still.
_STILL = 0.15


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
    t, d = recording.time, recording.displacement
    half = velocity_window(t, d)
    window = max(3, round(2 * half / float(np.median(np.diff(t)))))
    still = _STILL * typical_speed(t, d)
    velocity = local_line(t, d, t, half, min(5, len(t))).slope
    motion = np.where(np.abs(velocity) <= still, 0, np.sign(velocity)).astype(int)
    motion = _without_blips(motion, max(2, window // 2))
    motion = _fitted_corners(t, d, motion, window)
    labels = np.array([UNLOADING, HOLD, LOADING])[motion + 1].astype("<U9")
    if contact.in_air:
        smooth, _ = smooth_displacement(t, d)
        touched = np.flatnonzero(smooth >= contact.displacement)
        labels[: touched[0] if len(touched) else len(labels)] = AIR
    _mark_separation(recording, labels)
    return labels


def _without_blips(motion: NDArray[np.int_], shortest: int) -> NDArray[np.int_]:
    motion = motion.copy()
    starts = np.flatnonzero(np.diff(motion, prepend=motion[0] - 9))
    ends = np.append(starts[1:], len(motion))
    for start, end in zip(starts, ends, strict=True):
        if end - start < shortest and start > 0:
            motion[start:end] = motion[start - 1]
    return motion


def _fitted_corners(
    t: FloatArray, d: FloatArray, motion: NDArray[np.int_], window: int
) -> NDArray[np.int_]:
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
    costs = np.full(len(t), np.inf)
    for i in range(2, len(t) - 1):
        bent = t - t[i]
        design = np.column_stack([np.ones_like(t), np.minimum(bent, 0), np.maximum(bent, 0)])
        left = d - design @ np.linalg.lstsq(design, d, rcond=None)[0]
        costs[i] = left @ left
    return int(np.argmin(costs))


def _mark_separation(recording: Recording, labels: NDArray[np.str_]) -> None:
    """Call air what follows the force's return to a constant; unloading read backwards."""
    moving = np.flatnonzero(labels == UNLOADING)
    if len(moving) < 20:
        return
    deepest = int(np.argmax(recording.displacement))
    branch = moving[moving > deepest]
    if len(branch) < 20:
        return
    smooth, _ = smooth_displacement(recording.time[branch], recording.displacement[branch])
    back = branch[::-1]
    onset = fit_onset(
        smooth[::-1], recording.force[back], 0.0, sample_noise(recording.displacement)
    )
    if onset.in_air:
        left = branch[smooth < onset.displacement]
        if len(left):
            labels[left[0] :] = AIR

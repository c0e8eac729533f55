r"""Smoothing of a leg's shape, around its contours and along the leg.

Both ways penalise second differences (Whittaker's smoother): an undulation of wavelength
:math:`\lambda` keeps :math:`1/(1 + (\lambda_c/\lambda)^4)` of its amplitude, and what is straight
along the leg stays as it is, at the ends too. A contour's size is kept.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from scipy.linalg import solveh_banded

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.geometry.curve import closed_lengths
from legfem.geometry.leg_shape import LegShape, corresponding_loops


def smoothed(
    shape: LegShape, around: float = 0.0, along: float = 0.0, parts: Collection[str] | None = None
) -> LegShape:
    """Return the shape without its short undulations.

    Parameters
    ----------
    shape : LegShape
        With evenly spaced levels where it is smoothed along.
    around : float
        Wavelength around the contours of which half is left (mm); 0 smooths nothing.
    along : float
        The same along the leg (mm).
    parts : collection of str, optional
        Which to smooth; all by default.

    Raises
    ------
    InputError
        If the levels are not evenly spaced and ``along`` is not 0.
    """
    contours = {}
    for part, xy in shape.contours.items():
        smooth = np.array(xy)
        if parts is not None and part not in parts:
            contours[part] = smooth
            continue
        if around > 0:
            smooth = _around(smooth, around)
        if along > 0:
            smooth = _along(smooth, shape.levels, along)
        contours[part] = corresponding_loops(smooth)
    return LegShape(shape.levels, contours)


def _around(xy: FloatArray, wavelength: float) -> FloatArray:
    n = xy.shape[1]
    spacing = (closed_lengths(xy) / n)[:, None]
    # Of the second difference, squared; relative to that at the cut-off wavelength.
    stiffness = 2 - 2 * np.cos(2 * np.pi * np.fft.rfftfreq(n))[None, :]
    cut = 2 - 2 * np.cos(np.minimum(2 * np.pi * spacing / wavelength, np.pi))
    # Once around the contour is its size, not an undulation.
    stiffness = np.maximum(stiffness - stiffness[:, 1:2], 0.0)
    kept = 1 / (1 + (stiffness / cut) ** 2)
    return np.fft.irfft(np.fft.rfft(xy, axis=1) * kept[..., None], n, axis=1)


def _along(xy: FloatArray, levels: FloatArray, wavelength: float) -> FloatArray:
    steps = np.diff(levels)
    if np.ptp(steps) > 1e-6 * steps.mean():
        raise InputError(
            "shape",
            "levels",
            "are not evenly spaced, so the leg can't be smoothed along them",
            "resample the shape first",
        )
    n = len(levels)
    if n < 3:
        return xy
    cut = 2 - 2 * np.cos(min(2 * np.pi * steps.mean() / wavelength, np.pi))
    difference = np.diff(np.eye(n), 2, axis=0)
    matrix = np.eye(n) + difference.T @ difference / cut**2
    banded = np.stack([np.pad(np.diagonal(matrix, k), (k, 0)) for k in (2, 1, 0)])
    solved: FloatArray = solveh_banded(banded, xy.reshape(n, -1)).reshape(xy.shape)
    return solved

"""The surface of a part of a leg's shape, as a smooth function around and along it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import RectBivariateSpline

from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import LegShape

_WRAPPED = 6  # points repeated beyond the contour's start and end, for a periodic spline


class PartSurface:
    """Bicubic surface through the contours of one part.

    Parameters
    ----------
    shape : LegShape
        The leg.
    part : str
        One of its parts.
    """

    def __init__(self, shape: LegShape, part: str) -> None:
        xy = shape.contours[part]
        n = xy.shape[1]
        turns = np.arange(-_WRAPPED, n + _WRAPPED) / n
        wrapped = np.take(xy, np.arange(-_WRAPPED, n + _WRAPPED) % n, axis=1)
        degree = min(3, len(shape.levels) - 1)
        self._coordinates = [
            RectBivariateSpline(shape.levels, turns, wrapped[..., k], kx=degree, ky=3)
            for k in range(2)
        ]
        steps = np.linalg.norm(xy - np.roll(xy, 1, axis=1), axis=2)
        self.perimeter = float(steps.sum(axis=1).mean())
        """Mean along the leg, mm."""

    def __call__(self, turns: ArrayLike, levels: ArrayLike) -> FloatArray:
        """Return the points at a position around (in turns) and along the leg (z, mm); (..., 3)."""
        u, z = np.broadcast_arrays(np.mod(turns, 1.0), np.asarray(levels, dtype=np.float64))
        x, y = (coordinate.ev(z, u) for coordinate in self._coordinates)
        return np.stack([x, y, z], axis=-1)

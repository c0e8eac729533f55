"""The surface of a part of a leg's shape, as a smooth function around and along it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import RectBivariateSpline
from scipy.spatial import cKDTree

from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import LegShape

_SPACING = 2.0
"""Of the points among which the nearest is looked for first (mm)."""
_CORRECTIONS = 4
"""Of a position around the leg; they converge quadratically near the surface."""
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
        self._levels = shape.levels
        n = xy.shape[1]
        turns = np.arange(-_WRAPPED, n + _WRAPPED) / n
        wrapped = np.take(xy, np.arange(-_WRAPPED, n + _WRAPPED) % n, axis=1)
        degree = min(3, len(shape.levels) - 1)
        self._coordinates = [
            RectBivariateSpline(shape.levels, turns, wrapped[..., k], kx=degree, ky=3) for k in range(2)
        ]
        steps = np.linalg.norm(xy - np.roll(xy, 1, axis=1), axis=2)
        self.perimeter = float(steps.sum(axis=1).mean())
        """Mean along the leg, mm."""

    def __call__(self, turns: ArrayLike, levels: ArrayLike) -> FloatArray:
        """Return the points at a position around (in turns) and along the leg (z, mm); (..., 3)."""
        u, z = np.broadcast_arrays(np.mod(turns, 1.0), np.asarray(levels, dtype=np.float64))
        x, y = (coordinate.ev(z, u) for coordinate in self._coordinates)
        return np.stack([x, y, z], axis=-1)

    def beside(self, points: FloatArray) -> FloatArray:
        """Return the nearest points of the surface at the levels of points near it, (n, 3)."""
        xy, z = points[:, :2], np.clip(points[:, 2], self._levels[0], self._levels[-1])
        around = np.arange(0.0, 1.0, _SPACING / self.perimeter)
        along = np.linspace(z.min(), z.max(), 2 + int(np.ptp(z) / _SPACING))
        sampled = self(around[:, None], along[None, :])
        _, nearest = cKDTree(sampled.reshape(-1, 3)).query(np.column_stack([xy, z]))
        u = around[nearest // len(along)]
        for _ in range(_CORRECTIONS):
            missed = xy - self(u, z)[:, :2]
            slope = np.column_stack([coordinate.ev(z, np.mod(u, 1.0), dy=1) for coordinate in self._coordinates])
            u = u + np.einsum("ij,ij->i", missed, slope) / np.einsum("ij,ij->i", slope, slope)
        return self(u, z)

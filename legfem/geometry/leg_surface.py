"""Surfaces of a leg: triangulated ones with values on them, and smooth functions around and along a part."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import RectBivariateSpline
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import LegShape

CANDIDATES = 24


@dataclass(frozen=True, eq=False)
class TriangleSurface:
    """A surface of flat triangles.

    Parameters
    ----------
    points : (n, 3) array
        mm.
    triangles : (m, 3) int array
        Indices of points.
    """

    points: FloatArray
    triangles: NDArray[np.int64]

    def weights(self, points: FloatArray) -> csr_matrix:
        """Return the matrix that interpolates values at the surface's points to points nearby.

        Parameters
        ----------
        points : (k, 3) array
            mm; each takes the value of the surface's point nearest to it.

        Returns
        -------
        csr_matrix
            (k, n), rows of three weights that sum to one.
        """
        import trimesh  # slow to import, and of use to a leg in 3D alone

        corners = self.points[self.triangles]
        count = min(CANDIDATES, len(corners))
        _, nearest = cKDTree(corners.mean(axis=1)).query(points, k=count)
        nearest = np.asarray(nearest).reshape(len(points), count)
        pairs = corners[nearest].reshape(-1, 3, 3)
        closest = trimesh.triangles.closest_point(pairs, np.repeat(points, count, axis=0))
        weights = trimesh.triangles.points_to_barycentric(pairs, closest).reshape(len(points), count, 3)
        on = closest.reshape(len(points), count, 3)
        best = np.argmin(np.linalg.norm(on - points[:, None], axis=2), axis=1)
        rows = np.arange(len(points))
        columns = self.triangles[nearest[rows, best]]
        indices = (np.repeat(rows, 3), columns.ravel())
        return csr_matrix((weights[rows, best].ravel(), indices), (len(points), len(self.points)))


def tube(levels: int, around: int) -> NDArray[np.int64]:
    """Return the triangles of a tube of points numbered by level and around, (m, 3)."""
    level, point = np.meshgrid(np.arange(levels - 1), np.arange(around), indexing="ij")
    a = (level * around + point).ravel()
    b = (level * around + (point + 1) % around).ravel()
    lower = np.stack([a, b, b + around], axis=1)
    upper = np.stack([a, b + around, a + around], axis=1)
    return np.concatenate([lower, upper])


_SPACING = 2.0
"""Spacing of the points among which the nearest is looked for first (mm)."""
_CORRECTIONS = 4
"""Newton steps for a position around the leg; they converge quadratically near the surface."""
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

    def nearest_at_level(self, points: FloatArray) -> FloatArray:
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

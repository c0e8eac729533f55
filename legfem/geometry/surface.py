"""Triangulated surfaces, and values on them at points nearby."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from legfem.common.units import FloatArray

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
        corners = self.points[self.triangles]
        count = min(CANDIDATES, len(corners))
        _, nearest = cKDTree(corners.mean(axis=1)).query(points, k=count)
        nearest = np.asarray(nearest).reshape(len(points), count)
        weights = _nearest_weights(points[:, None], corners[nearest])
        on = np.einsum("kci,kcix->kcx", weights, corners[nearest])
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


def _nearest_weights(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the barycentric weights (..., 3) of the point of a triangle nearest to a point."""
    a, b, c = (corners[..., i, :] for i in range(3))
    inside = _projected(points, a, b, c)
    candidates = [
        np.where((inside >= 0).all(axis=-1, keepdims=True), inside, np.nan),
        *(_on_side(points, corners, i) for i in range(3)),
    ]
    every = np.stack(candidates, axis=-2)
    on = np.einsum("...wi,...ix->...wx", every, corners)
    distance = np.linalg.norm(on - points[..., None, :], axis=-1)
    best = np.nanargmin(distance, axis=-1)
    return np.take_along_axis(every, best[..., None, None], axis=-2)[..., 0, :]


def _projected(p: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    u, v, w = b - a, c - a, p - a
    uu, vv, uv = (np.sum(s * t, axis=-1) for s, t in ((u, u), (v, v), (u, v)))
    wu, wv = np.sum(w * u, axis=-1), np.sum(w * v, axis=-1)
    size = uu * vv - uv**2
    second = (vv * wu - uv * wv) / size
    third = (uu * wv - uv * wu) / size
    return np.stack([1 - second - third, second, third], axis=-1)


def _on_side(p: FloatArray, corners: FloatArray, first: int) -> FloatArray:
    second = (first + 1) % 3
    a, b = corners[..., first, :], corners[..., second, :]
    share = np.sum((p - a) * (b - a), axis=-1) / np.sum((b - a) ** 2, axis=-1)
    share = np.clip(share, 0.0, 1.0)
    weights = np.zeros((*share.shape, 3))
    weights[..., first], weights[..., second] = 1 - share, share
    return weights

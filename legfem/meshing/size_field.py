r"""Sizes of elements that grow with the distance from where they are given.

.. math:: h(x) = \min\Big(h_\infty,\; \min_b\,(h_b + g\,|x - x_b|)\Big)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from legfem.common.units import FloatArray

_ALIKE = 1.1  # sizes within this ratio count as the same


@dataclass(frozen=True, eq=False)
class SizeField:
    """Sizes at points, and how they grow from there.

    Parameters
    ----------
    points : (n, 3) array
        Where sizes are given, mm.
    sizes : (n,) array
        mm.
    growth : float
        Growth of the size per mm of distance.
    far_size : float
        Greatest size, mm.
    """

    points: FloatArray
    sizes: FloatArray
    growth: float
    far_size: float

    def __call__(self, points: FloatArray) -> FloatArray:
        """Return the sizes at some points (m, 3); (m,), mm."""
        found = np.full(len(points), self.far_size)
        for size, tree in self._trees:
            if size < self.far_size:
                reach = (self.far_size - size) / self.growth
                distance, _ = tree.query(points, distance_upper_bound=reach)
                found = np.minimum(found, size + self.growth * distance)
        return found

    @cached_property
    def _trees(self) -> list[tuple[float, cKDTree]]:
        """Trees of the points with about the same size."""
        group = np.floor(np.log(self.sizes) / np.log(_ALIKE)).astype(int)
        return [(float(self.sizes[group == g].mean()), cKDTree(self.points[group == g])) for g in np.unique(group)]


def bilinear(grid: FloatArray, low: tuple[float, float], step: tuple[float, float]) -> Callable[..., float]:
    """Return a fast function of (x, y) that interpolates values on a regular grid."""
    values: Any = grid.tolist()
    (x0, y0), (dx, dy) = low, step
    last_x, last_y = grid.shape[0] - 2, grid.shape[1] - 2

    def interpolated(x: float, y: float) -> float:
        a, b = (x - x0) / dx, (y - y0) / dy
        i, j = min(max(int(a), 0), last_x), min(max(int(b), 0), last_y)
        a, b = min(max(a - i, 0.0), 1.0), min(max(b - j, 0.0), 1.0)
        here, following = values[i], values[i + 1]
        return (1 - a) * ((1 - b) * here[j] + b * here[j + 1]) + a * ((1 - b) * following[j] + b * following[j + 1])

    return interpolated


def trilinear(grid: FloatArray, low: FloatArray, step: FloatArray) -> Callable[..., float]:
    """Return a fast function of (x, y, z) that interpolates values on a regular grid."""
    layers = [bilinear(layer, (low[0], low[1]), (step[0], step[1])) for layer in grid]
    z0, dz, last = float(low[2]), float(step[2]), len(layers) - 2

    def interpolated(x: float, y: float, z: float) -> float:
        c = (z - z0) / dz
        k = min(max(int(c), 0), last)
        c = min(max(c - k, 0.0), 1.0)
        return (1 - c) * layers[k](x, y) + c * layers[k + 1](x, y)

    return interpolated

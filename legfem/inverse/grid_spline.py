"""Cubic splines through values at zero and at a grid: linear in the values, so that the grid's part is made once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline, PPoly

from legfem.common.units import FloatArray

type At = Callable[[FloatArray], FloatArray]
"""Courses (m + 1, k), at zero and at a grid, to what they are at displacements (n, k)."""


@dataclass(frozen=True, eq=False)
class GridSpline:
    """Makes splines through values at zero and at a grid's m displacements.

    Parameters
    ----------
    grid
        (m,), mm, rising from above zero.
    """

    grid: FloatArray

    @cached_property
    def _knots(self) -> FloatArray:
        return np.concatenate([[0.0], self.grid])

    @cached_property
    def _coefficients(self) -> FloatArray:
        """Of every piece by the values, (4 m, m + 1), the cubic ones of all pieces first."""
        own = CubicSpline(self._knots, np.eye(len(self._knots))).c
        return np.ascontiguousarray(own.reshape(-1, len(self._knots)))

    def through(self, values: FloatArray) -> PPoly:
        """Return the spline through values (m + 1,)."""
        return PPoly.construct_fast((self._coefficients @ values).reshape(4, -1), self._knots)

    def at(self, displacement: FloatArray) -> At:
        """Return what evaluates courses (m + 1, k) at displacements (n,), as (n, k); below zero as at zero."""
        inside = np.maximum(displacement, 0.0)
        piece = np.minimum(np.searchsorted(self.grid, inside, side="right"), len(self.grid) - 1)
        t = (inside - self._knots[piece])[:, None]

        def evaluated(courses: FloatArray) -> FloatArray:
            cubic, square, linear, constant = (self._coefficients @ courses).reshape(4, len(self.grid), -1)[:, piece]
            return np.asarray(((cubic * t + square) * t + linear) * t + constant)

        return evaluated

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
    def _pieces(self) -> FloatArray:
        """Coefficients (m, 4, m + 1) of every piece by the values, the cubic one first."""
        return np.ascontiguousarray(np.moveaxis(CubicSpline(self._knots, np.eye(len(self._knots))).c, 0, 1))

    def through(self, values: FloatArray) -> PPoly:
        """Return the spline through values (m + 1,)."""
        return PPoly.construct_fast(np.ascontiguousarray((self._pieces @ values).T), self._knots)

    def at(self, displacement: FloatArray) -> At:
        """Return what evaluates courses (m + 1, k) at displacements (n,), as (n, k); below zero as at zero."""
        inside = np.maximum(displacement, 0.0)
        piece = np.clip(np.searchsorted(self._knots, inside, side="right") - 1, 0, len(self.grid) - 1)
        t = inside - self._knots[piece]
        powers = np.stack([t**3, t**2, t, np.ones(len(t))], axis=1)

        def evaluated(courses: FloatArray) -> FloatArray:
            return np.asarray(np.einsum("nq,nqk->nk", powers, (self._pieces @ courses)[piece]))

        return evaluated

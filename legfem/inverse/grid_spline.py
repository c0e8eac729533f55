"""Cubic splines through values at zero and at a grid: linear in the values, so that the grid's part is made once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline, PPoly

from legfem.common.units import FloatArray


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

    def weights(self, at: FloatArray) -> FloatArray:
        """Return what splines take of their values at displacements (n,), (n, m + 1); below zero as at zero."""
        inside = np.maximum(at, 0.0)
        piece = np.clip(np.searchsorted(self._knots, inside, side="right") - 1, 0, len(self.grid) - 1)
        t = inside - self._knots[piece]
        powers = np.stack([t**3, t**2, t, np.ones(len(t))], axis=1)
        return np.asarray(np.einsum("nk,nkm->nm", powers, self._pieces[piece]))

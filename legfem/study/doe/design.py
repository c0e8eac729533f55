"""The points at which a study simulates, coded to -1..1."""

from __future__ import annotations

import numpy as np
from pyDOE3 import ff2n, lhs

from legfem.common.units import FloatArray


def factorial_design(factors: int) -> FloatArray:
    """Return all corners, then the centre; (2^k + 1, k)."""
    corners = np.asarray(ff2n(factors), dtype=float)
    return np.vstack([corners, np.zeros((1, factors))])


def space_filling_design(factors: int, points: int, seed: int) -> FloatArray:
    """Return a Latin hypercube whose points keep apart; (points, k)."""
    if points == 0:
        return np.zeros((0, factors))
    if points == 1:
        return np.random.default_rng(seed).uniform(-1, 1, (1, factors))
    unit = lhs(factors, samples=points, criterion="maximin", iterations=200, seed=seed)
    return 2 * np.asarray(unit, dtype=float) - 1

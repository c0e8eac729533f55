"""From a point in the right valley to the valley's floor, in genes."""

from __future__ import annotations

import numpy as np

from legfem.common.units import FloatArray
from legfem.inference.least_squares import Residual, least_residual


def polished(residual: Residual, start: FloatArray) -> FloatArray:
    """Return the genes (p,), each from 0 to 1, of the least residual near a start."""
    return least_residual(residual, start, np.tile([0.0, 1.0], (len(start), 1)))


def polished_with(residual: Residual, start: FloatArray, k: int, held: float) -> FloatArray:
    """Return the same with gene k held."""
    rest = polished(lambda genes: residual(np.insert(genes, k, held)), np.delete(start, k))
    return np.insert(rest, k, held)

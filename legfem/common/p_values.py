"""Corrections of p-values for how many were looked at."""

from collections.abc import Sequence

import numpy as np

from legfem.common.units import FloatArray


def holm(p_values: Sequence[float] | FloatArray) -> FloatArray:
    """Return family-wise p-values (n,) of tests that may depend on each other.

    The k-th smallest of n is n - k + 1 times as large, none smaller than the one before it, and 1 at most: S. Holm,
    Scand. J. Stat. 6 (1979) 65.

    Parameters
    ----------
    p_values
        p-values of single tests, (n,).
    """
    given = np.asarray(p_values, dtype=float)
    order = np.argsort(given)
    adjusted = np.empty_like(given)
    adjusted[order] = np.maximum.accumulate(given[order] * np.arange(len(given), 0, -1))
    return np.minimum(adjusted, 1.0)

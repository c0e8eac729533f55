"""What a column of readings can't have been: a clock that counts rows, a cell at its limit."""

from __future__ import annotations

import numpy as np

from legfem.common.units import FloatArray

_MANY_ROWS = 200
"""Of loading: with one a second it would take minutes."""


def counts_samples(time: FloatArray) -> bool:
    """Return whether times (n,) of a loading seem to be the rows' number."""
    return len(time) > _MANY_ROWS and np.allclose(np.diff(time), 1.0, 0.0, 1e-6)


def cut_off(displacement: FloatArray, force: FloatArray) -> float:
    """Return the longest way (mm) in which the force stays at its greatest value exactly.

    Parameters
    ----------
    displacement, force
        (n,), mm and N, of a loading.
    """
    top = np.append(force >= force.max(), False)
    edges = np.flatnonzero(np.diff(top.astype(int), prepend=0)).reshape(-1, 2)
    return max(float(displacement[end - 1] - displacement[start]) for start, end in edges)

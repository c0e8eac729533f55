"""Anderson's mixing: updates with factors of an earlier tangent learn from each other.

Such updates shrink by the same factor again and again. The combination of the last ones that leaves
the least update of all is about as good as a Krylov method on the tangent would be, and needs no
tangent: D. G. Anderson, J. ACM 12 (1965) 547-560; H. F. Walker and P. Ni, SIAM J. Numer. Anal. 49
(2011) 1715-1735.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from legfem.common.units import FloatArray

_SMALLEST = 1e-8
"""Over the largest: singular values of the updates' products that are rounding."""


class AndersonMixing:
    """The states and updates since the tangent was factorised.

    Parameters
    ----------
    comm
        Over whose ranks the unknown is spread.
    depth
        Earlier updates that are remembered; 0 for none.
    """

    def __init__(self, comm: MPI.Comm, depth: int) -> None:
        self._comm, self._depth = comm, depth
        self._past: list[tuple[FloatArray, FloatArray]] = []

    def forget(self) -> None:
        """Begin anew: the factors are others."""
        self._past.clear()

    def improved(self, state: FloatArray, update: FloatArray) -> FloatArray | None:
        """Return a better update, to be added to a state, or None at the first with these factors.

        Parameters
        ----------
        state, update
            A rank's own part; (n,).
        """
        now = state.copy(), update.copy()
        earlier = self._past[-self._depth :] if self._depth else []
        self._past = [*earlier, now]
        if not earlier:
            return None
        states = np.array([state - other for other, _ in earlier])
        updates = np.array([update - other for _, other in earlier])
        products = self._comm.allreduce(updates @ np.vstack([updates, update]).T)
        size = np.sqrt(np.diag(products))
        if not np.all(size > 0):
            return None
        matrix, right = products[:, :-1] / np.outer(size, size), products[:, -1] / size
        share = np.linalg.lstsq(matrix, right, rcond=_SMALLEST)[0] / size
        return np.asarray(update - (states + updates).T @ share)

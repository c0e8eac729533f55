"""What every test of the second code shares: felupe's elements, steps and Newton's iteration."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import splu

from legfem.common.units import FloatArray

_ITERATIONS, _LEAST_STEP_MM = 25, 0.02


@dataclass(frozen=True, eq=False)
class OtherCurve:
    """The whole indenter's force (N) at displacements (mm); (n,)."""

    displacement: FloatArray
    force: FloatArray
    reached: bool
    moved: FloatArray
    """What all nodes have moved by at the end, one after the other, mm."""


def spread(
    shape: FloatArray, parts: NDArray[np.int_], force: FloatArray, stiffness: FloatArray, size: int
) -> tuple[FloatArray, csr_matrix]:
    """Return nodal forces (size,) and their tangent, of what acts at Gauss points of the skin.

    Parameters
    ----------
    shape
        Functions of n nodes at q Gauss points, (q, n).
    parts
        Nodes of k edges or faces, (k, n).
    force, stiffness
        Weighted, (k, q, d) and (k, q, d, d).
    size
        Number of displacements.
    """
    d = force.shape[2]
    places = d * parts[:, :, None] + np.arange(d)
    total = np.zeros(size)
    np.add.at(total, places.ravel(), np.einsum("qn,kqd->knd", shape, force).ravel())
    blocks = np.einsum("qn,qm,kqde->kndme", shape, shape, stiffness)
    flat = places.reshape(len(parts), -1)
    width = flat.shape[1]
    rows, columns = np.repeat(flat, width, axis=1).ravel(), np.tile(flat, (1, width)).ravel()
    return total, coo_matrix((blocks.ravel(), (rows, columns)), shape=(size, size)).tocsr()


class OtherPressing(ABC):
    """A body of felupe's elements, and a rigid one pressed into it.

    Parameters
    ----------
    bodies
        Field and solid body of every tissue.
    reduction
        From what is free to all displacements.
    travel
        Direction, a unit vector.
    whole
        Force of the whole indenter over that of the model.
    """

    def __init__(
        self, bodies: Sequence[tuple[Any, Any]], reduction: csr_matrix, travel: FloatArray, whole: float
    ) -> None:
        self._bodies, self._reduction = bodies, reduction
        self.travel, self.whole = travel, whole

    @property
    def unknowns(self) -> int:
        """How many displacements are free."""
        return int(self._reduction.shape[1])

    @abstractmethod
    def _untouched(self) -> Any:
        """Return what the contact remembers before the first touch."""

    @abstractmethod
    def _contact(self, u: FloatArray, to: float, before: Any) -> tuple[FloatArray, Any, FloatArray, Any]:
        """Return the indenter's force on the skin, its tangent, the resultant, what to remember."""

    def _held(self, free: FloatArray, left: FloatArray, matrix: Any) -> tuple[FloatArray, Any]:
        """Return residual and tangent with what holds the body beside its tissue and the skin."""
        return left, matrix

    def _solved(self, matrix: Any, right: FloatArray) -> FloatArray:
        """Return the solution of a linear system."""
        return np.asarray(splu(matrix.tocsc()).solve(right))

    def solve(self, depth: float, step: float = 0.5) -> OtherCurve:
        """Press the indenter in; the curve ends where Newton's iteration doesn't converge."""
        free = np.zeros(self._reduction.shape[1])
        earlier = free
        before = self._untouched()
        at, force = [0.0], [0.0]
        size, last = min(step, 0.25), 1.0
        while at[-1] < depth - 1e-9 and size > _LEAST_STEP_MM:
            to = min(at[-1] + size, depth)
            # A secant's guess: as far again as in the step before.
            guess = free + (free - earlier) * (to - at[-1]) / last if len(at) > 2 else free
            found = self._newton(guess, to, before)
            if found is None:
                size *= 0.5
                continue
            earlier, free = free, found
            last = to - at[-1]
            resultant, before = self._contact(self._reduction @ free, to, before)[2:]
            at.append(to)
            force.append(float(resultant @ self.travel) * self.whole)
            size = min(step, 1.5 * size)
        reached = at[-1] >= depth - 1e-9
        return OtherCurve(np.array(at), np.array(force), reached, self._reduction @ free)

    def _newton(self, free: FloatArray, to: float, before: Any) -> FloatArray | None:
        T = self._reduction
        largest = 0.0
        for _ in range(_ITERATIONS):
            u = T @ free
            inner, stiffness = self._tissue(u)
            outer, tangent, _, _ = self._contact(u, to, before)
            left = T.T @ (inner - outer)
            matrix = T.T @ (stiffness + tangent) @ T
            left, matrix = self._held(free, left, matrix)
            if not np.isfinite(left).all():
                return None
            largest = max(largest, float(np.abs(outer).max()), 1e-9)
            change = self._solved(matrix, -left)
            free = free + change
            if np.abs(change).max() < 1e-5 and np.abs(left).max() < 1e-3 * largest:
                return free
            if np.abs(change).max() > 50:
                return None
        return None

    def _tissue(self, u: FloatArray) -> tuple[FloatArray, Any]:
        """Return the tissue's force and its tangent."""
        inner, total = np.zeros(len(u)), None
        for holder, body in self._bodies:
            values = holder[0].values
            values[:] = u.reshape(values.shape)
            inner += np.asarray(body.assemble.vector(holder).todense()).ravel()
            matrix = body.assemble.matrix(holder)
            total = matrix if total is None else total + matrix
        return inner, total

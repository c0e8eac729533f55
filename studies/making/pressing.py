"""What every test of the second code shares: the tissues' laws as it asks for them, elements, steps and contact."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import splu

from legfem.common.units import FloatArray


@dataclass(frozen=True)
class DeepTissue:
    """The deep tissue's law as felupe asks for it: stress and tangent of the gradient; MPa.

    Parameters
    ----------
    c10, c20, alpha, beta
        Of the energy's isochoric part.
    second, fourth
        Coefficients of (J - 1)^2 and (J - 1)^4.
    """

    c10: float
    c20: float
    alpha: float
    beta: float
    second: float
    fourth: float
    x: tuple[FloatArray, FloatArray] = field(default_factory=lambda: (np.zeros((3, 3)), np.zeros(0)), repr=False)

    def gradient(self, x: Sequence[FloatArray], **unused: Any) -> list[FloatArray]:
        """Return the first Piola-Kirchhoff stress (3, 3, ...) and no state."""
        F, state = x[0], x[-1]
        J, H, strain, G = _isochoric(F)
        return [self._slopes(strain)[0] * G + self._pressures(J)[0] * J * H, state]

    def hessian(self, x: Sequence[FloatArray], **unused: Any) -> list[FloatArray]:
        """Return its derivative (3, 3, 3, 3, ...)."""
        F = x[0]
        J, H, strain, G = _isochoric(F)
        first, second = self._slopes(strain)
        by_j, by_jj = self._pressures(J)
        I1 = np.einsum("ij...,ij...->...", F, F)
        one = np.eye(3)
        HH = np.einsum("ij...,kl...->ijkl...", H, H)
        crossed = np.einsum("kj...,il...->ijkl...", H, H)
        unit = np.einsum("ik,jl->ijkl", one, one).reshape((3,) * 4 + (1,) * (F.ndim - 2))
        change = -2 / 3 * np.einsum("ij...,kl...->ijkl...", G, H) + J ** (-2 / 3) * (
            2 * unit - 2 / 3 * (2 * np.einsum("ij...,kl...->ijkl...", H, F) - I1 * crossed)
        )
        return [
            second * np.einsum("ij...,kl...->ijkl...", G, G)
            + first * change
            + (by_jj * J**2 + by_j * J) * HH
            - by_j * J * crossed
        ]

    def _slopes(self, strain: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the isochoric energy's derivatives by its strain."""
        grown = self.alpha * np.exp(self.beta * strain)
        return self.c10 + 2 * self.c20 * strain + grown, 2 * self.c20 + self.beta * grown

    def _pressures(self, J: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the volumetric energy's derivatives by J."""
        e = J - 1
        return 2 * self.second * e + 4 * self.fourth * e**3, (2 * self.second + 12 * self.fourth * e**2)


def other_law(
    c10: float, d1: float, c20: float = 0.0, d2: float | None = None, exponential: tuple[float, float] = (0.0, 1.0)
) -> Any:
    """Return felupe's law of stiffnesses in MPa, of D1 and D2 in 1/MPa; D2 None is infinite.

    With a C10 of 0 it resists changes of volume alone.
    """
    import felupe as fem

    alpha, beta = exponential
    if c10 > 0 and c20 == 0 and alpha == 0:
        return fem.NeoHooke(mu=2 * c10, bulk=2 / d1)
    return DeepTissue(c10, c20, alpha, beta, 1 / d1, 0.0 if d2 is None else 1 / d2)


def _isochoric(F: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return J, the transposed inverse of F, the first invariant less 3, and its derivative."""
    J = np.linalg.det(np.moveaxis(F, (0, 1), (-2, -1)))
    inverse = np.linalg.inv(np.moveaxis(F, (0, 1), (-2, -1)))
    H = np.moveaxis(inverse, (-1, -2), (0, 1))
    I1 = np.einsum("ij...,ij...->...", F, F)
    G = J ** (-2 / 3) * (2 * F - 2 / 3 * I1 * H)
    return J, H, J ** (-2 / 3) * I1 - 3, G


_ITERATIONS, _LEAST_STEP_MM = 25, 0.02


@dataclass(frozen=True, eq=False)
class OtherCurve:
    """The whole indenter's force (N) at displacements (mm); (n,)."""

    displacement: FloatArray
    force: FloatArray
    reached: bool
    moved: FloatArray
    """What all nodes have moved by at the end, one after the other, mm."""
    channels: Mapping[str, FloatArray] = field(default_factory=dict)
    """What else is seen, by name, as legfem's channels are called; (n,)."""


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

    def _seen(self, u: FloatArray, resultant: FloatArray) -> Mapping[str, float]:
        """Return what else is seen of a state (mm), the resultant (N) on the model given."""
        return {}

    def _begin(self, free: FloatArray) -> None:
        """Prepare for Newton's method, which begins from what is free: what meets what."""
        self._met: Any = None

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
        seen = [self._seen(self._reduction @ free, np.zeros(len(self.travel)))]
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
            seen.append(self._seen(self._reduction @ free, resultant))
            size = min(step, 1.5 * size)
        reached = at[-1] >= depth - 1e-9
        every = {name: np.array([one[name] for one in seen]) for name in seen[0]}
        channels = {name: values for name, values in every.items() if np.isfinite(values).all()}
        return OtherCurve(np.array(at), np.array(force), reached, self._reduction @ free, channels)

    def _newton(self, free: FloatArray, to: float, before: Any) -> FloatArray | None:
        T = self._reduction
        self._begin(free)
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


BULK = 300.0
"""Bulk over shear modulus: identification takes 1000."""
_MOST_ITERATIONS, _LEAST = 25, 1e-10


@dataclass(frozen=True)
class OtherMuscle(DeepTissue):
    """A deep tissue with fibres; MPa.

    Parameters
    ----------
    shear, extension
        s and e.
    axis
        Of the fibres.
    """

    shear: float = 0.0
    extension: float = 0.0
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)

    @classmethod
    def of_ratio(cls, c10: float, c20: float, ratio: float, axis: tuple[float, float, float]) -> OtherMuscle:
        """Return a tissue of a ratio of shear moduli along and across."""
        shear = 2 * c10 * (ratio - 1)
        return cls(c10, c20, 0.0, 1.0, BULK * c10, 0.0, shear=shear, extension=4 * shear, axis=axis)

    def gradient(self, x: Sequence[FloatArray], **unused: Any) -> list[FloatArray]:
        """Return the first Piola-Kirchhoff stress (3, 3, ...) and no state."""
        stress, state = super().gradient(x)
        F, a = x[0], np.array(self.axis)
        b, c, fc = self._vectors(F)
        added = self.shear * (np.einsum("m...,n...->mn...", b, c) + np.einsum("m...,n->mn...", fc, a))
        return [stress + added + self._slope(b) * np.einsum("m...,n->mn...", b, a), state]

    def hessian(self, x: Sequence[FloatArray], **unused: Any) -> list[FloatArray]:
        """Return its derivative (3, 3, 3, 3, ...)."""
        F, a, one = x[0], np.array(self.axis), np.eye(3)
        b, c, _ = self._vectors(F)
        B = np.einsum("mi...,ki...->mk...", F, F)
        sheared = (
            np.einsum("mk,l,n...->mnkl...", one, a, c)
            + np.einsum("m...,nl,k...->mnkl...", b, one, b)
            + np.einsum("m...,kn...,l->mnkl...", b, F, a)
            + np.einsum("mk,l...,n->mnkl...", one, c, a)
            + np.einsum("ml...,k...,n->mnkl...", F, b, a)
            + np.einsum("mk...,l,n->mnkl...", B, a, a)
        )
        unit = np.einsum("mk,l,n->mnkl", one, a, a).reshape((3,) * 4 + (1,) * (F.ndim - 2))
        twice = self.extension - 4 * self.shear
        along = np.einsum("m...,n,k...,l->mnkl...", b, a, b, a)
        return [super().hessian(x)[0] + self.shear * sheared + self._slope(b) * unit + twice * along]

    def _vectors(self, F: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        b = np.einsum("ij...,j->i...", F, np.array(self.axis))
        c = np.einsum("ij...,i...->j...", F, b)
        return b, c, np.einsum("ij...,j...->i...", F, c)

    def _slope(self, b: FloatArray) -> FloatArray:
        I4 = np.einsum("i...,i...->...", b, b)
        return np.asarray(self.extension / 2 * (I4 - 1) - 2 * self.shear * I4)


def pulled_bar(muscle: OtherMuscle, stretches: FloatArray) -> FloatArray:
    """Return nominal stresses (n,), MPa, of a bar along x whose ends slide, by felupe's hexahedra.

    Raises
    ------
    RuntimeError
        If Newton's method doesn't converge.
    """
    import felupe as fem

    cube = fem.Cube(n=3)
    field = fem.FieldContainer([fem.Field(fem.RegionHexahedron(cube), dim=3)])
    body, moved = fem.SolidBody(muscle, field), np.zeros(cube.points.shape)
    held = cube.points < 1e-9
    end = cube.points[:, 0] > 1 - 1e-9
    held[end, 0] = True
    free, fixed = np.flatnonzero(~held.ravel()), np.flatnonzero(held.ravel())
    found = []
    for stretch in stretches:
        to = np.zeros(moved.shape)
        to[end, 0] = stretch - 1
        for _ in range(_MOST_ITERATIONS):
            field[0].values[:] = moved
            force = body.assemble.vector(field).toarray().ravel()
            stiffness = body.assemble.matrix(field).tocsc()
            carried = (to - moved).ravel()[fixed]
            pushed = force[free] + stiffness[free][:, fixed] @ carried
            change = splu(stiffness[free][:, free]).solve(-pushed)
            moved.ravel()[free] += change
            moved.ravel()[fixed] += carried
            if max(np.abs(change).max(), np.abs(carried).max()) < _LEAST:
                break
        else:
            raise RuntimeError(f"felupe: no equilibrium at a stretch of {stretch:g}")
        found.append(float(force.reshape(-1, 3)[end, 0].sum()))
    return np.array(found)

r"""Fibrous tissue as a second code asks for it, and a bar of it that felupe pulls.

.. math:: W = C_{10} (\bar I_1 - 3) + C_{20} (\bar I_1 - 3)^2 + (J - 1)^2 / D_1
          + \tfrac{s}{2} (I_5 - I_4^2) + \tfrac{e}{8} (I_4 - 1)^2

with :math:`I_4 = b \cdot b`, :math:`I_5 = c \cdot c`, :math:`b = F a` and :math:`c = F^T b`; stress
and tangent were derived by hand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse.linalg import splu

from legfem.common.units import FloatArray
from studies.concealed.other_tissue import DeepTissue

BULK = 300.0
"""Bulk over shear modulus: identification takes 1000."""
_ITERATIONS, _LEAST = 25, 1e-10


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
        for _ in range(_ITERATIONS):
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

"""A damping of Newton's steps: a force on every displacement towards an earlier state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from legfem.common.units import FloatArray
from legfem.fem.system import System


@dataclass(frozen=True, eq=False)
class Damping:
    """A force on every displacement towards an earlier state; see `legfem.solve.relaxation`."""

    anchor: FloatArray
    """The unknown there, ghosts included."""
    strength: float
    """Over the median of the tangent's diagonal."""


class Damper:
    """Adds a damping to a system's residual and tangent.

    Parameters
    ----------
    system
        The model.
    """

    def __init__(self, system: System) -> None:
        self._system = system
        self._damping: Damping | None = None
        self._stiffness: FloatArray | None = None

    @property
    def acts(self) -> bool:
        """Whether the step is damped."""
        return self._damping is not None

    def turn_to(self, damping: Damping | None) -> None:
        """Damp as is said, from now on."""
        self._damping = damping
        if damping is not None and self._stiffness is None:
            self._stiffness = self._usual_stiffness()

    def stiffen(self, tangent: PETSc.Mat) -> None:
        """Add the damping's stiffness to an assembled tangent."""
        if self._damping is not None:
            added = self._system.unknown.x.petsc_vec.duplicate()
            added.array[:] = self._weights(self._damping)
            tangent.setDiagonal(added, addv=PETSc.InsertMode.ADD)

    def push(self, residual: FloatArray) -> None:
        """Add the damping's forces at the system's present unknown to a residual (n,)."""
        if self._damping is not None:
            weights = self._weights(self._damping)
            own = slice(len(weights))
            away = self._system.unknown.x.array[own] - self._damping.anchor[own]
            residual[own] += weights * away

    def _weights(self, damping: Damping) -> FloatArray:
        assert self._stiffness is not None
        return damping.strength * self._stiffness

    def _usual_stiffness(self) -> FloatArray:
        """Return the median of the tangent's diagonal, on the rank's own free displacements."""
        diagonal = np.abs(self._system.assemble_tangent().getDiagonal().array)
        free = np.zeros(len(diagonal), dtype=bool)
        displacements = self._system.spaces.displacement_dofs
        free[displacements[displacements < len(free)]] = True
        free[self._system.owned_supports] = False
        everywhere = np.concatenate(self._system.comm.allgather(diagonal[free]))
        return np.where(free, np.median(everywhere), 0.0)

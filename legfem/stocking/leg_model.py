"""A leg's segment that wears a stocking: its shape, its mesh, and its shape when compressed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from legfem.body_surfaces import BodySurface, hull_surface, skin_surface
from legfem.experiments.compression import Compressed, CompressionSettings, LegCompression
from legfem.fixed_point import AndersonMixing
from legfem.geometry.leg_shape import HULL, SKIN, LegShape
from legfem.geometry.shape_motion import displaced
from legfem.geometry.surface import TriangleSurface, tube
from legfem.materials import Hyperelastic
from legfem.meshing.solid_leg import SolidMeshSettings, mesh_solid_leg
from legfem.stocking.laplace import Stocking, StockingLoad, stocking_load
from legfem.terms import StiffnessGradient, VolumeLoss
from legfem.units import FloatArray

SURFACES = (SKIN, HULL)


@dataclass(frozen=True)
class FixedPointSettings:
    """Of the pressure that depends on the shape that it makes.

    Parameters
    ----------
    tolerance : float
        Change of the pressure from one state to the next, over its greatest value.
    max_states : int
        Compressed states to solve for.
    """

    tolerance: float = 2e-3
    max_states: int = 12


@dataclass(frozen=True, eq=False)
class Worn:
    """A leg in a stocking, in equilibrium with it."""

    state: Compressed
    shape: LegShape
    """Compressed."""
    load: StockingLoad
    """At the reference shape's levels and points."""
    changes: tuple[float, ...]
    """Of the pressure between states, relative."""
    converged: bool


class LegModel3D:
    """Mesh and solver of a leg's segment, by its shape.

    Parameters
    ----------
    shape
        Of the bare leg.
    tissues
        Law of the deep and the superficial tissue.
    mesh
        Sizes of the elements.
    settings
        Of the solution.
    comm
        Over which one solution is spread.
    """

    def __init__(
        self,
        shape: LegShape,
        tissues: Mapping[str, Hyperelastic],
        mesh: SolidMeshSettings | None = None,
        settings: CompressionSettings | None = None,
        comm: MPI.Intracomm = MPI.COMM_SELF,
    ) -> None:
        self.shape = shape
        mechanisms = (
            VolumeLoss("deep"),
            StiffnessGradient("deep", tissues["deep"], level=float(shape.levels.mean())),
        )
        self.compression = LegCompression(
            mesh_solid_leg(shape, mesh, comm), tissues, settings, mechanisms
        )

    def solve(
        self,
        pressure: FloatArray,
        parameters: Mapping[str, float] | None = None,
        sensitivities: Sequence[str] = (),
        start: Compressed | None = None,
    ) -> Compressed:
        """Find the state under a pressure at the skin's points, (n_levels, n_points), MPa."""
        nodal = self._to_mesh @ pressure.ravel()
        return self.compression.solve(nodal, parameters, sensitivities, start)

    def pressure_rates(self, state: Compressed, changes: Sequence[FloatArray]) -> list[FloatArray]:
        """Return the unknown's derivatives at the last state by changes of the skin's pressure."""
        return self.compression.pressure_rates(
            state, [self._to_mesh @ change.ravel() for change in changes]
        )

    def displacement(self, part: str, unknown: FloatArray) -> FloatArray:
        """Return the displacement (mm) of the points of skin or hull, (n_levels, n_points, 3).

        Parameters
        ----------
        part
            ``"skin"`` or ``"hull"``.
        unknown
            Of a state, or a derivative of it: then the displacement's derivative is returned.
        """
        nodal = unknown[self.compression.spaces.displacement_dofs].reshape(-1, 3)
        moved = self._from_mesh[part] @ self._surfaces[part].values(nodal)
        return moved.reshape(*self.shape.contours[part].shape[:2], 3)

    def deformed_shape(self, unknown: FloatArray, levels: FloatArray | None = None) -> LegShape:
        """Return the leg's shape in a state, at levels (mm); those of the bare leg by default."""
        moved = {part: self.displacement(part, unknown) for part in SURFACES}
        return displaced(self.shape, moved, levels)

    def wear(
        self,
        stocking: Stocking,
        parameters: Mapping[str, float] | None = None,
        settings: FixedPointSettings | None = None,
        on_state: Callable[[str], None] | None = None,
    ) -> Worn:
        """Find the state in which the stocking's pressure is that of the shape it makes.

        ``on_state`` is called with a line after every state.
        """
        settings = settings or FixedPointSettings()
        load, state = stocking_load(self.shape, stocking), None
        pressure, mixing = load.pressure, AndersonMixing()
        changes: list[float] = []
        while True:
            state = self.solve(pressure, parameters, start=state)
            if not state.report.complete:
                return Worn(state, self.shape, load, tuple(changes), False)
            shape = self.deformed_shape(state.unknown)
            load = stocking_load(shape, stocking)
            difference = np.abs(load.pressure - pressure).max()
            changes.append(float(difference / load.pressure.max()))
            if on_state is not None:
                on_state(f"the pressure changes by {100 * changes[-1]:.2g} % of its greatest")
            converged = changes[-1] < settings.tolerance
            if converged or len(changes) == settings.max_states:
                return Worn(state, shape, load, tuple(changes), converged)
            pressure = np.maximum(mixing.next(pressure, load.pressure), 0.0)

    def put_in(self, worn: Worn, parameters: Mapping[str, float] | None = None) -> None:
        """Bring the system into a worn state, for what is evaluated there."""
        system = self.compression.system
        system.set_parameters({**system.model.parameters, **(parameters or {})})
        system.applied_pressure.x.array[:] = self._to_mesh @ worn.load.pressure.ravel()
        system.set_time(1.0, 1.0)
        system.unknown.x.array[:] = worn.state.unknown

    @cached_property
    def _surfaces(self) -> dict[str, BodySurface]:
        spaces = self.compression.spaces
        return {SKIN: skin_surface(spaces), HULL: hull_surface(spaces)}

    @cached_property
    def _from_mesh(self) -> dict[str, csr_matrix]:
        return {
            part: body.surface.weights(self.shape.points(part).reshape(-1, 3))
            for part, body in self._surfaces.items()
        }

    @cached_property
    def _to_mesh(self) -> csr_matrix:
        points = self.shape.points(SKIN)
        surface = TriangleSurface(points.reshape(-1, 3), tube(*points.shape[:2]))
        return surface.weights(self.compression.skin_points)

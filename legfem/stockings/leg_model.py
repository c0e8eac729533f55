"""Finite-element model of a leg's segment under pressure on its skin, as shapes and points of the scan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from mpi4py import MPI
from scipy.sparse import csr_matrix

from legfem.common.units import FloatArray
from legfem.experiments.compression import Compressed, CompressionSettings, LegCompression
from legfem.experiments.experiment import Picklable, cached_in_process
from legfem.fem.body_surfaces import BodySurface, hull_surface, skin_surface
from legfem.geometry.leg_shape import HULL, SKIN, LegShape
from legfem.geometry.leg_shape_motion import displaced
from legfem.geometry.leg_surface import TriangleSurface, tube
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.terms import Fascia, StiffnessGradient, VolumeLoss
from legfem.meshing.solid_leg import SolidMeshSettings, mesh_solid_leg

SURFACES = (SKIN, HULL)
PARAMETERS = ("deep.C10", "superficial.C10")
"""The stiffnesses of muscle and fat."""


@dataclass(frozen=True, eq=False)
class LegModel3D(Picklable):
    """A leg's segment by its shape, under pressures: an `legfem.experiments.experiment.Experiment`.

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

    shape: LegShape
    tissues: Mapping[str, Hyperelastic]
    mesh: SolidMeshSettings | None = None
    settings: CompressionSettings | None = None
    comm: MPI.Intracomm = field(default_factory=lambda: MPI.COMM_SELF, repr=False)

    @cached_in_process
    def compression(self) -> LegCompression:
        """The finite-element model, meshed and compiled."""
        mechanisms = (
            VolumeLoss("deep"),
            StiffnessGradient("deep", self.tissues["deep"], level=float(self.shape.levels.mean())),
            Fascia(),
        )
        meshed = mesh_solid_leg(self.shape, self.mesh, self.comm)
        return LegCompression(meshed, self.tissues, self.settings, mechanisms)

    @property
    def parameters(self) -> dict[str, float]:
        """Every number of the model by full name."""
        return self.compression.parameters

    def solve(
        self,
        values: Mapping[str, float] | None,
        pressure: FloatArray,
        sensitivities: Sequence[str] = (),
        start: Compressed | None = None,
    ) -> Compressed:
        """Find the state under a pressure at the skin's points, (n_levels, n_points), MPa."""
        nodal = self._to_mesh @ pressure.ravel()
        return self.compression.solve(values, nodal, sensitivities, start)

    def pressure_rates(
        self, state: Compressed, changes: Sequence[FloatArray], tolerance: float | None = None
    ) -> list[FloatArray]:
        """Return the unknown's derivatives at the last state by changes of the skin's pressure.

        ``tolerance`` is that of the linear solutions, by default as in solving.
        """
        return self.compression.pressure_rates(state, [self._to_mesh @ change.ravel() for change in changes], tolerance)

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

    def put_in(self, state: Compressed, pressure: FloatArray, parameters: Mapping[str, float] | None = None) -> None:
        """Bring the system into a state under its pressure, for what is evaluated there."""
        system = self.compression.system
        system.set_parameters(system.model.values(parameters))
        system.applied_pressure.x.array[:] = self._to_mesh @ pressure.ravel()
        system.set_time(1.0, 1.0)
        system.unknown.x.array[:] = state.unknown

    @cached_in_process
    def _surfaces(self) -> dict[str, BodySurface]:
        spaces = self.compression.spaces
        return {SKIN: skin_surface(spaces), HULL: hull_surface(spaces)}

    @cached_in_process
    def _from_mesh(self) -> dict[str, csr_matrix]:
        return {
            part: body.surface.weights(self.shape.points(part).reshape(-1, 3)) for part, body in self._surfaces.items()
        }

    @cached_in_process
    def _to_mesh(self) -> csr_matrix:
        points = self.shape.points(SKIN)
        surface = TriangleSurface(points.reshape(-1, 3), tube(*points.shape[:2]))
        return surface.weights(self.compression.skin_points)

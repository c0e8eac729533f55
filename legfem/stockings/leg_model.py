"""Finite-element model of a leg's segment under pressure on its skin, as shapes and points of the scan."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from mpi4py import MPI
from scipy.sparse import csr_matrix

from legfem.common.units import FloatArray
from legfem.experiments.compression import Compressed, CompressionSettings, LegCompression
from legfem.experiments.experiment import Picklable, cached_in_process
from legfem.fem.spaces import BodySurface, hull_surface, skin_surface
from legfem.geometry.leg_shape import HULL, SKIN, LegShape
from legfem.geometry.leg_shape_motion import displaced
from legfem.geometry.leg_surface import TriangleSurface, tube
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.terms import Fascia, StiffnessGradient, VolumeLoss
from legfem.meshing.leg_sizes import SolidMeshSettings
from legfem.meshing.solid_leg import mesh_solid_leg

SURFACES = (SKIN, HULL)
PARAMETERS = ("deep.C10", "superficial.C10")
"""Full names of the stiffnesses of muscle and fat."""


@dataclass(frozen=True, eq=False)
class LegModel3D(Picklable):
    """Finite elements of a leg's segment, addressed by the points of its scanned shape.

    Parameters
    ----------
    shape
        Bare leg.
    tissues
        Laws of the deep and the superficial tissue.
    mesh
        Element sizes.
    settings
        Formulation and solver.
    comm
        Ranks that share one solution.
    """

    shape: LegShape
    tissues: Mapping[str, Hyperelastic]
    mesh: SolidMeshSettings | None = None
    settings: CompressionSettings | None = None
    comm: MPI.Intracomm = field(default_factory=lambda: MPI.COMM_SELF, repr=False)

    @cached_in_process
    def compression(self) -> LegCompression:
        """Meshed and compiled problem, made at first use."""
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
        """Solve for the state under a pressure at the skin's points, (n_levels, n_points), MPa."""
        nodal = self._to_mesh @ pressure.ravel()
        return self.compression.solve(values, nodal, sensitivities, start)

    def pressure_rates(
        self, state: Compressed, changes: Sequence[FloatArray], tolerance: float | None = None
    ) -> list[FloatArray]:
        """Differentiate the unknown by changes of the pressure at the skin's points, in the last state.

        ``tolerance`` is the linear solver's, that of Newton's method by default.
        """
        return self.compression.pressure_rates(state, [self._to_mesh @ change.ravel() for change in changes], tolerance)

    def displacement(self, part: str, unknown: FloatArray) -> FloatArray:
        """Return the displacement (mm) of the points of skin or hull, (n_levels, n_points, 3).

        Parameters
        ----------
        part
            ``"skin"`` or ``"hull"``.
        unknown
            A state's, or a derivative of it, of which the displacement's derivative is returned.
        """
        nodal = unknown[self.compression.spaces.displacement_dofs].reshape(-1, 3)
        moved = self._from_mesh[part] @ self._surfaces[part].values(nodal)
        return moved.reshape(*self.shape.contours[part].shape[:2], 3)

    def deformed_shape(self, unknown: FloatArray, levels: FloatArray | None = None) -> LegShape:
        """Return the compressed shape cut at levels (mm), by default those of the bare leg."""
        moved = {part: self.displacement(part, unknown) for part in SURFACES}
        return displaced(self.shape, moved, levels)

    def set_state(self, state: Compressed, pressure: FloatArray, parameters: Mapping[str, float] | None = None) -> None:
        """Put the finite-element system into a state and its pressure, to evaluate fields or derivatives."""
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

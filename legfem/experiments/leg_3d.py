"""An indenter pressed into a leg in 3D: into a leg as it is, and into the idealised one, in 3D or in plane strain."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from mpi4py import MPI
from shapely import Polygon, union_all

from legfem.channels.kinds import files_of
from legfem.channels.log import ChannelReader
from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.experiments.experiment import cached_in_process
from legfem.experiments.indentation import IndentationModel, IndentationTest, leg_model
from legfem.experiments.indenter_pose import Cylinder, LegIndenter, Pose
from legfem.fem.spaces import build_spaces
from legfem.fem.system import System
from legfem.geometry.leg_shape import SKIN, LegShape, PartSurface
from legfem.mechanics.contact import ContactSettings
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.model import LegModel, Term
from legfem.mechanics.terms import Fascia
from legfem.meshing.grid import Support
from legfem.meshing.leg_sizes import FineStrip, SolidMeshSettings
from legfem.meshing.solid_leg import mesh_solid_leg
from legfem.meshing.structured import END, IdealisedLeg, LegMesh, LegMeshSettings, mesh_leg
from legfem.solve.linear import LinearSettings
from legfem.solve.newton import NewtonSolver
from legfem.solve.settings import NewtonSettings, StepSettings

_LEVELS = 41
"""Points along the leg at which first touch is sought."""
_TURNS = 720
"""Points round the leg at which first touch is sought."""
_LOOKS = 3
"""Refinements of that grid."""


@dataclass(frozen=True)
class SolidLegSettings:
    """Numerical settings: quadratic displacements, continuous linear pressures (Taylor-Hood).

    ``contact_size`` (mm) is that of elements under the cylinder. Steps don't adapt to the work, so
    that any solver and number of ranks goes through the same states.
    """

    mesh: SolidMeshSettings = field(
        default_factory=lambda: SolidMeshSettings(
            skin_size=18.0, inside_size=26.0, bone_size=14.0, layer_elements=0.3, turn_elements=7.0, enclosing=True
        )
    )
    contact_size: float = 4.5
    contact: ContactSettings = field(default_factory=ContactSettings)
    newton: NewtonSettings = field(default_factory=lambda: NewtonSettings(reuse=0.7))
    linear: LinearSettings = field(default_factory=LinearSettings)
    steps: StepSettings = field(default_factory=lambda: StepSettings.regular(largest=2.0))


def membrane_of(fascia: Hyperelastic, thickness: float) -> Fascia:
    """Return the membrane of a layer's law and thickness (mm)."""
    return Fascia(2 * fascia.C10 * thickness, fascia.D1 * fascia.C10)


@dataclass(frozen=True, eq=False)
class LegIndentation3D(IndentationTest):
    """The test on a leg's own shape; its end faces stay in their planes, its bones are held.

    Parameters
    ----------
    shape
        Shape of the leg, longer than the cylinder.
    indenter, pose
        Indenter and its pose.
    tissues
        Laws of the deep and the superficial tissue, and of muscles that have one of their own, by region.
    fascia
        Fascia as a membrane, see `membrane_of`; none by default.
    settings
        Numerical settings.
    comm
        Ranks that one solution is spread over.
    mechanisms
        Terms that are added to the model.
    muscles
        Outlines (n, 2), mm, of the muscles of which tissues have a law, alike at all levels.

    Raises
    ------
    InputError
        For an indenter beyond the leg, or one that misses it.
    """

    shape: LegShape
    indenter: LegIndenter
    pose: Pose
    tissues: Mapping[str, Hyperelastic]
    fascia: Fascia = field(default_factory=Fascia)
    settings: SolidLegSettings = field(default_factory=SolidLegSettings)
    comm: MPI.Intracomm = field(default_factory=lambda: MPI.COMM_SELF, repr=False)
    mechanisms: tuple[Term, ...] = ()
    muscles: Mapping[str, tuple[FloatArray, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check that the indenter lies over the leg."""
        low, high = self._span
        if low < self.shape.levels[0] or high > self.shape.levels[-1]:
            problem = f"it reaches from {low:g} to {high:g} mm and leaves the leg, "
            problem += f"{self.shape.levels[0]:g} to {self.shape.levels[-1]:g} mm"
            raise InputError("indenter", "level", problem, "scan a longer part of the leg, or give another level")

    @cached_property
    def _skin(self) -> PartSurface:
        return PartSurface(self.shape, SKIN)

    @property
    def _span(self) -> tuple[float, float]:
        reach = self.indenter.reach(self.pose)
        return self.pose.level - reach, self.pose.level + reach

    @cached_property
    def model(self) -> LegModel:
        """Mechanical model: the sum of its terms."""
        laws = {region: self.tissues[region] for region in ("superficial", "deep", *self.muscles)}
        base = leg_model(laws, self.indenter.placed(self.pose), self.settings.contact, "continuous")
        return base.with_terms((self.fascia, *self.mechanisms))

    @cached_property
    def touch(self) -> FloatArray:
        """The indenter's middle (3,), mm, where it first touches the leg."""
        aim, frame = np.array([*self.pose.aim, self.pose.level]), self.pose.frame
        turns, levels = (0.0, 1.0), self._span
        for _ in range(_LOOKS):
            round_it, along = np.linspace(*turns, _TURNS), np.linspace(*levels, _LEVELS)
            points = self._skin(round_it[:, None] % 1.0, along[None, :]) - aim
            way = points @ frame[2] - self.indenter.ahead(points @ frame[:2].T)
            if np.all(np.isnan(way)):
                problem = "the line of travel misses the leg"
                raise InputError("indenter", "aim", problem, "give a point inside the leg, and check the direction")
            turn, level = np.unravel_index(np.nanargmin(way), way.shape)
            turns = _neighbours(round_it, int(turn))
            low, high = _neighbours(along, int(level))
            levels = max(low, self._span[0]), min(high, self._span[1])
        return np.asarray(aim + np.nanmin(way) * frame[2])

    @cached_in_process
    def leg_mesh(self) -> LegMesh:
        """The mesh, fine under the indenter."""
        frame, (ahead, half) = self.pose.frame, self.indenter.contact
        middle = self.touch + ahead * frame[2]
        low, high = (middle + side * half * frame[0] for side in (-1, 1))
        reach, size = 1.2 * self.indenter.radius, self.settings.contact_size
        strip = FineStrip((_triple(low), _triple(high)), reach, size)
        muscles = {name: union_all(list(map(Polygon, own))) for name, own in self.muscles.items()}
        return mesh_solid_leg(self.shape, replace(self.settings.mesh, strip=strip), self.comm, muscles)

    def _made(self) -> IndentationModel:
        meshed, settings = self.leg_mesh, self.settings
        held = (*meshed.supports, Support(END, (2,)))
        spaces = build_spaces(*meshed.tagged, "continuous", 2, meshed.regions, held)
        rounding = self._skin.nearest_at_level
        system = System(spaces, self.model, self.touch, self.pose.direction, rounding=rounding)
        solver = NewtonSolver(system, settings.newton, settings.linear)
        radius = self.indenter.radius
        reader = ChannelReader(system, files_of("3d"))
        return IndentationModel(system, solver, settings.contact, radius, 1.0, settings.steps, reader)


def _neighbours(values: FloatArray, k: int) -> tuple[float, float]:
    """Return the values two places before and after one."""
    step = float(values[1] - values[0])
    return float(values[k]) - 2 * step, float(values[k]) + 2 * step


def _triple(point: FloatArray) -> tuple[float, float, float]:
    x, y, z = map(float, point)
    return x, y, z


@dataclass(frozen=True)
class IdealisedLegSettings:
    """Numerical settings of both models of the idealised leg.

    The pressure under the cylinder's end edges is several times that of plane strain, and so is the
    contact's stiffness. The steps don't adapt to the work, which differs between linear solvers and
    numbers of ranks: all go through the same states.
    """

    mesh: LegMeshSettings = field(default_factory=LegMeshSettings)
    contact: ContactSettings = field(default_factory=lambda: ContactSettings(stiffness=4000.0))
    newton: NewtonSettings = field(default_factory=NewtonSettings)
    linear: LinearSettings = field(default_factory=LinearSettings)
    steps: StepSettings = field(default_factory=StepSettings.regular)
    formulation: Literal["displacement", "mixed"] = "mixed"


@dataclass(frozen=True, eq=False)
class IdealisedLegIndentation(IndentationTest):
    """The test on the idealised leg; solves for any parameters without meshing again.

    Parameters
    ----------
    leg, cylinder
        Sizes.
    tissues
        Law of every region the leg has.
    dimension
        3, or 2 for plane strain on the same grid; the force is that of the whole cylinder in both.
    settings
        Numerical.
    comm
        Ranks that one solution is spread over.
    mechanisms
        Terms that are added to the model, for example `legfem.mechanics.terms.Fibres`.

    Raises
    ------
    InputError
        For a cylinder that leaves the leg, or an edge radius that the mesh doesn't resolve.
    """

    leg: IdealisedLeg
    cylinder: Cylinder
    tissues: Mapping[str, Hyperelastic]
    dimension: Literal[2, 3] = 3
    settings: IdealisedLegSettings = field(default_factory=IdealisedLegSettings)
    comm: MPI.Intracomm = field(default_factory=lambda: MPI.COMM_SELF, repr=False)
    mechanisms: tuple[Term, ...] = ()

    def __post_init__(self) -> None:
        """Check what is given."""
        mesh = self.settings.mesh
        if mesh.cells == "tetrahedra" and self.settings.formulation == "mixed":
            raise InputError(
                "mesh", "cells", "tetrahedra have no mixed form here", "choose the displacement form with them"
            )
        if self.dimension == 3:
            _check_ends(self.leg, self.cylinder, mesh)

    @cached_property
    def model(self) -> LegModel:
        """Mechanical model: the sum of its terms."""
        laws = {region: self.tissues[region] for region in self.leg.regions}
        shape, settings = self.cylinder.shape(self.dimension), self.settings
        return leg_model(laws, shape, settings.contact, settings.formulation).with_terms(self.mechanisms)

    @cached_in_process
    def leg_mesh(self) -> LegMesh:
        """The mesh: a quarter of the leg, or half of its section."""
        length = self.cylinder.length if self.dimension == 3 else None
        return mesh_leg(self.leg, self.cylinder.radius, length, self.settings.mesh, self.comm)

    def _made(self) -> IndentationModel:
        meshed, settings, cylinder = self.leg_mesh, self.settings, self.cylinder
        degree = settings.mesh.degree
        spaces = build_spaces(*meshed.tagged, settings.formulation, degree, meshed.regions, meshed.supports)
        start, direction = np.zeros(self.dimension), np.zeros(self.dimension)
        start[1], direction[1] = self.leg.radius + cylinder.radius, -1.0
        system = System(spaces, self.model, start, direction)
        solver = NewtonSolver(system, settings.newton, settings.linear)
        whole = float(meshed.copies) * (1.0 if self.dimension == 3 else cylinder.length)
        return IndentationModel(system, solver, settings.contact, cylinder.radius, whole, settings.steps)


def _check_ends(leg: IdealisedLeg, cylinder: Cylinder, mesh: LegMeshSettings) -> None:
    if cylinder.length >= leg.length and leg.ends == "free":
        problem = f"{cylinder.length:g} mm is no shorter than the leg of {leg.length:g} mm, whose ends are free"
        raise InputError("cylinder", "length", problem, "make the leg longer, or hold its ends")
    if cylinder.length < leg.length and mesh.edge_size > 2 * cylinder.edge_radius * mesh.degree:
        problem = f"{cylinder.edge_radius:g} mm is not resolved by elements of {mesh.edge_size:g} mm "
        problem += f"and degree {mesh.degree}"
        remedy = f"give a mesh size at the cylinder's end of {2 * cylinder.edge_radius * mesh.degree:g}"
        remedy += " mm or less, or a larger radius"
        raise InputError("cylinder", "edge_radius", problem, remedy)

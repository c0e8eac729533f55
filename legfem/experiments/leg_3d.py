"""A cylinder of finite length pressed into a leg as it is, in 3D."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from mpi4py import MPI

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.experiments.base import made_when_needed
from legfem.experiments.indentation_3d import Cylinder
from legfem.experiments.pressing import Pressing, PressingTest, leg_model
from legfem.experiments.tissues import tissues_of
from legfem.fem.spaces import build_spaces
from legfem.fem.system import System
from legfem.geometry.leg_shape import SKIN, LegShape
from legfem.geometry.shape_motion import without_layer
from legfem.geometry.shape_surface import PartSurface
from legfem.mechanics.contact_settings import ContactSettings
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.model import LegModel, Term
from legfem.mechanics.terms import Fascia, Fibres
from legfem.meshing.idealised_leg import END, LegMesh
from legfem.meshing.section import first_touch
from legfem.meshing.solid_leg import FineStrip, SolidMeshSettings, mesh_solid_leg
from legfem.meshing.support import Support
from legfem.solve.linear import LinearSettings
from legfem.solve.newton import NewtonSettings, NewtonSolver
from legfem.solve.step_settings import StepSettings
from legfem.subjects.spatial import SpatialLeg
from legfem.subjects.subject import Subject

_LEVELS, _TURNS = 41, 720
"""Along the cylinder and round the leg, at which the skin is looked for."""


@dataclass(frozen=True)
class Pose:
    """Where the cylinder, its axis along the leg, is pressed.

    Parameters
    ----------
    aim : (float, float)
        A point on its line of travel (mm).
    level : float
        Of its middle (mm).
    direction_deg : float
        Of its travel, from +x counter-clockwise.
    """

    aim: tuple[float, float]
    level: float
    direction_deg: float

    @property
    def direction(self) -> FloatArray:
        """Of the travel: a unit vector (3,)."""
        angle = np.radians(self.direction_deg)
        return np.array([np.cos(angle), np.sin(angle), 0.0])


@dataclass(frozen=True)
class SolidLegSettings:
    """Numerical settings: quadratic displacements, continuous linear pressures (Taylor-Hood).

    ``contact_size`` (mm) is that of elements under the cylinder. Steps don't adapt to the work, so
    that any solver and number of ranks goes through the same states.
    """

    mesh: SolidMeshSettings = field(
        default_factory=lambda: SolidMeshSettings(
            skin_size=18.0,
            inside_size=26.0,
            bone_size=14.0,
            layer_elements=0.3,
            turn_elements=7.0,
            enclosing=True,
        )
    )
    contact_size: float = 4.5
    contact: ContactSettings = field(default_factory=ContactSettings)
    newton: NewtonSettings = field(default_factory=lambda: NewtonSettings(reuse=0.7))
    linear: LinearSettings = field(default_factory=LinearSettings)
    steps: StepSettings = field(default_factory=lambda: StepSettings.regular(largest=2.0))
    quadrature_degree: int = 4


def membrane_of(fascia: Hyperelastic, thickness: float) -> Fascia:
    """Return the membrane of a layer's law and thickness (mm)."""
    return Fascia(2 * fascia.C10 * thickness, fascia.D1 * fascia.C10)


FIBRE_PARAMETERS = tuple(Fibres("deep").parameters)
"""By which the force is differentiated for the error of what is known of fibres."""


def fibres_of(c10: float, ratio: float) -> Fibres:
    """Return the muscle's fibres along the leg, of a C10 (MPa) across them and a ratio."""
    return Fibres.of_ratio("deep", c10, ratio)


@dataclass(frozen=True, eq=False)
class LegIndentation3D(PressingTest):
    """The test on a leg's own shape; its end faces stay in their planes, its bones are held.

    Parameters
    ----------
    shape
        Of the leg, longer than the cylinder.
    cylinder, pose
        What presses, and where.
    tissues
        Laws of the deep and the superficial tissue.
    fascia
        As a membrane, see `membrane_of`; none by default.
    settings
        Numerical.
    comm
        Over which one solution is spread.
    mechanisms
        Terms that are added to the model.

    Raises
    ------
    InputError
        For a cylinder beyond the leg, or one that misses it.
    """

    shape: LegShape
    cylinder: Cylinder
    pose: Pose
    tissues: Mapping[str, Hyperelastic]
    fascia: Fascia = field(default_factory=Fascia)
    settings: SolidLegSettings = field(default_factory=SolidLegSettings)
    comm: MPI.Intracomm = field(default_factory=lambda: MPI.COMM_SELF, repr=False)
    mechanisms: tuple[Term, ...] = ()

    @classmethod
    def of_subject(
        cls,
        subject: Subject,
        leg: SpatialLeg,
        settings: SolidLegSettings | None = None,
        comm: MPI.Intracomm = MPI.COMM_SELF,
    ) -> LegIndentation3D:
        """Return the test of a subject; see `legfem.subjects.spatial.spatial_leg`.

        The fascia's layer has no thickness here, and between soft tissues it doesn't yield across
        it: it is taken out of the leg, so that fat and muscle are as thick as they are.
        """
        given, tissues, fibres = subject.indenter, tissues_of(subject), subject.fibres
        thickness = subject.section.fascia_thickness
        pose = Pose((float(given.aim[0]), float(given.aim[1])), 0.0, given.direction_deg)
        return cls(
            without_layer(leg.shape, thickness),
            Cylinder(given.radius, given.length),
            pose,
            {"deep": tissues.deep, "superficial": tissues.superficial},
            membrane_of(tissues.fascia, thickness),
            settings or SolidLegSettings(),
            comm,
            () if fibres is None else (fibres_of(tissues.deep.C10, fibres.value),),
        )

    def __post_init__(self) -> None:
        """Check that the cylinder lies over the leg."""
        low, high = self._span
        if low < self.shape.levels[0] or high > self.shape.levels[-1]:
            raise InputError(
                "indenter", "level",
                f"the cylinder from {low:g} to {high:g} mm leaves the leg, "
                f"{self.shape.levels[0]:g} to {self.shape.levels[-1]:g} mm",
                "scan a longer part of the leg, or give another level",
            )  # fmt: skip

    @cached_property
    def _skin(self) -> PartSurface:
        return PartSurface(self.shape, SKIN)

    @property
    def _span(self) -> tuple[float, float]:
        half = self.cylinder.length / 2
        return self.pose.level - half, self.pose.level + half

    @cached_property
    def model(self) -> LegModel:
        """The sum of terms."""
        laws = {region: self.tissues[region] for region in ("superficial", "deep")}
        base = leg_model(laws, self.cylinder.shape(3), self.settings.contact, "continuous")
        return base.with_terms((self.fascia, *self.mechanisms))

    @cached_property
    def touch(self) -> FloatArray:
        """The cylinder's middle (3,), mm, where it first touches the leg."""
        aim, travel = np.array(self.pose.aim), self.pose.direction[:2]
        turns = np.linspace(0.0, 1.0, _TURNS, endpoint=False)[:, None]
        points = self._skin(turns, np.linspace(*self._span, _LEVELS)[None, :])
        middles = [
            first_touch(points[:, k, :2], self.cylinder.radius, aim, travel) for k in range(_LEVELS)
        ]
        first = min(middles, key=lambda middle: float((middle - aim) @ travel))
        return np.array([*first, self.pose.level])

    @made_when_needed
    def leg_mesh(self) -> LegMesh:
        """The mesh, fine under the cylinder."""
        (low, high), radius = self._span, self.cylinder.radius
        x, y, _ = self.touch + radius * self.pose.direction
        strip = FineStrip(((x, y, low), (x, y, high)), 1.2 * radius, self.settings.contact_size)
        return mesh_solid_leg(self.shape, replace(self.settings.mesh, strip=strip), self.comm)

    def _made(self) -> Pressing:
        meshed, settings = self.leg_mesh, self.settings
        spaces = build_spaces(
            meshed.mesh,
            meshed.cell_tags,
            meshed.facet_tags,
            "continuous",
            2,
            meshed.regions,
            (*meshed.supports, Support(END, (2,))),
        )
        system = System(
            spaces, self.model, self.touch, self.pose.direction, settings.quadrature_degree,
            self._skin.beside,
        )  # fmt: skip
        solver = NewtonSolver(system, settings.newton, settings.linear)
        radius = self.cylinder.radius
        return Pressing(system, solver, settings.contact, radius, 1.0, settings.steps)

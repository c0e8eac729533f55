"""A cylinder pressed, in plane strain, into a leg's cross-section."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from shapely import Point

from legfem.channels import Sight
from legfem.channels.kinds import files_of
from legfem.channels.log import ChannelReader
from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.experiments import indentation
from legfem.experiments.experiment import Solved, as_protocol, cached_in_process
from legfem.fem.fields import most_stretched
from legfem.fem.sliding import SlidingForces
from legfem.fem.spaces import Tags, build_spaces
from legfem.fem.system import Shift, System
from legfem.geometry.indenter import Indenter, TravelLine, first_touch
from legfem.geometry.section import LegSection, across
from legfem.mechanics.contact import ContactSettings
from legfem.mechanics.indenters import RigidCylinder
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.model import Formulation, LegModel, RegionTerm, Term
from legfem.mechanics.terms import BoneSprings, SlidingFace
from legfem.meshing.grid import Support
from legfem.meshing.section import (
    BONE,
    PLATE,
    REGIONS,
    SKIN,
    MeshMotion,
    SectionMesh,
    SectionMeshSettings,
    bone_regions,
    mesh_section,
    section_regions,
)
from legfem.solve.newton import NewtonSolver
from legfem.solve.path import ForceCurve
from legfem.solve.protocol import Protocol
from legfem.solve.settings import NewtonSettings, StepSettings


@dataclass(frozen=True)
class LateralPlacement:
    """Deviation of the line of travel from the stated one: a lateral offset and a tilt.

    Parameters
    ----------
    tilt_deg : float
        Angle that the travel is turned by, about the point of first touch, counter-clockwise
        (degrees). The load cell turns with it.
    offset_mm : float
        Shift of the line, before it is turned, to the left of the travel stated (mm); zero
        displacement stays at first touch.

    Raises
    ------
    InputError
        For numbers that aren't finite, or a travel turned by 60 degrees or more.
    """

    tilt_deg: float = 0.0
    offset_mm: float = 0.0

    def __post_init__(self) -> None:
        """Check both numbers."""
        for name in ("tilt_deg", "offset_mm"):
            if not math.isfinite(getattr(self, name)):
                raise InputError("placement", name, "is not finite", "give a finite number")
        if abs(self.tilt_deg) >= 60:
            raise InputError("placement", "tilt_deg", f"is {self.tilt_deg:g}", "give less than 60 degrees")

    def aim(self, aim: FloatArray, direction: FloatArray) -> FloatArray:
        """Return a point on the shifted line, from one on the line stated (mm)."""
        return aim + self.offset_mm * across(direction)

    def travel(self, direction: FloatArray) -> FloatArray:
        """Return the turned unit vector of travel."""
        angle = math.radians(self.tilt_deg)
        x, y = direction
        return np.array([math.cos(angle) * x - math.sin(angle) * y, math.sin(angle) * x + math.cos(angle) * y])


@dataclass(frozen=True)
class Tissues:
    """The laws of the three tissues, and of muscles and groups that have one of their own (MPa, 1/MPa).

    Of a limb without muscle, which is ``alone`` of one tissue, that of ``deep`` counts.
    """

    deep: Hyperelastic
    superficial: Hyperelastic
    fascia: Hyperelastic
    muscles: Mapping[str, Hyperelastic] = field(default_factory=dict)
    alone: bool = False

    @property
    def laws(self) -> dict[str, Hyperelastic]:
        """Laws by the name of what they are of."""
        outer = {} if self.alone else {"superficial": self.superficial, "fascia": self.fascia}
        return {**outer, "deep": self.deep, **self.muscles}


_SAME_FORCE = 0.03
"""Relative difference of force by which a form without pressures may depart from one with them, where both go."""
_MOST_WORK = 180
"""Factorisations after which nothing else is tried: some three curves' worth."""
_RAISED_DEGREE = 6
"""Degree of quadrature that is tried where a solution with the usual one stops."""
_SLIDES_MM = 120.0
"""Arc either way of first touch along which the mesh slides with the cylinder."""
_NEAR_MM = 15.0
"""Distance from a bone within which a message names it, mm."""


@dataclass(frozen=True)
class PlaneStrainSettings:
    """Numerical settings; the defaults are those that the convergence study states errors for."""

    mesh: SectionMeshSettings = field(default_factory=SectionMeshSettings)
    contact: ContactSettings = field(default_factory=ContactSettings)
    newton: NewtonSettings = field(default_factory=lambda: NewtonSettings(1e-8, reuse=0.7, keeps_body=True))
    # The same steps at about any stiffness: curves are compared, and differences of them taken.
    steps: StepSettings = field(
        default_factory=lambda: StepSettings.regular(first=0.125, smallest=0.05, curve_tolerance=2e-3, most_astray=48)
    )
    formulation: Formulation = "mixed"
    drained_skin: bool = False
    """Whether the fat's fluid can leave through the skin, in a porous form."""
    quadrature_degree: int = 4
    defences: bool = True
    """Whether a jump to another equilibrium, more points of integration, a form without pressures
    and then a softer contact are tried when a solution stops short, until `_MOST_WORK`."""


@dataclass(frozen=True, eq=False)
class PlaneStrainIndentation(indentation.IndentationTest):
    """The plane-strain test on one section; solves for any parameters without meshing again.

    Parameters
    ----------
    section
        Section of the leg.
    indenter
        Cylinder and line of travel; the force is that of its whole length.
    tissues
        Laws of the tissues; their parameters are the defaults of `solve`.
    settings
        Numerical settings.
    comm
        Ranks that one solution is spread over.
    mechanisms
        Terms added to those of tissues and contact, each in place of one of its name if there is.
    motions
        Errors of outlines and of the line of travel by name, by which a solution can be differentiated, by one of each.
    meshed
        Mesh of the section, if there is one already; by default it is made when first needed.
    sights
        Places at which channels are read that have none of their own.

    Raises
    ------
    InputError
        For a ball, a punch or a cylinder that doesn't lie along the leg; or if only some of the bones are
        on springs.
    """

    section: LegSection
    indenter: Indenter
    tissues: Tissues
    settings: PlaneStrainSettings = field(default_factory=PlaneStrainSettings)
    comm: MPI.Intracomm = field(default_factory=lambda: MPI.COMM_SELF, repr=False)
    mechanisms: Sequence[Term] = ()
    motions: Mapping[str, MeshMotion | LateralPlacement] = field(default_factory=dict, repr=False)
    meshed: SectionMesh | None = field(default=None, repr=False)
    sights: tuple[Sight, ...] = ()

    def __post_init__(self) -> None:
        """Check that the section can have the indenter."""
        self.indenter.check_lies_along("subject.toml")
        if self._springs and {t.region for t in self._springs} != set(self.section.bones):
            remedy = f"give one for each of {' and '.join(self.section.bones)}; stiff springs hold a bone"
            raise InputError("mechanisms", "BoneSprings", "not every bone is on springs", remedy)

    @cached_property
    def model(self) -> LegModel:
        """Mechanical model: the sum of its terms."""
        cylinder, laws = RigidCylinder(self.indenter.radius), self.tissues.laws
        model = indentation.leg_model(laws, cylinder, self.settings.contact, self.settings.formulation)
        return model.with_terms(self.mechanisms)

    @property
    def _regions(self) -> dict[str, Tags]:
        """Cell tags of the tissues; muscles without a law of their own are deep tissue, whatever acts in them."""
        section, own, tags = self.section, self.tissues.muscles, section_regions(self.section)
        apart = [muscle for name in own for muscle in section.muscles_of(name)]
        acted_in = {t.region for t in self.mechanisms if isinstance(t, RegionTerm)}
        named = [name for name in (*section.groups, *section.muscles) if name in own or name in acted_in]
        found = {name: section.muscles_of(name) for name in named}
        if rest := [muscle for muscle in section.muscles if muscle not in apart]:
            found["deep"] = ("deep", *rest)
        layers = {name: tag for name, tag in tags.items() if name in REGIONS}
        return {**layers, **{name: tuple(tags[one] for one in of) for name, of in found.items()}}

    @property
    def _springs(self) -> list[BoneSprings]:
        """Of bones that are bodies on springs, in place of held outlines."""
        return [term for term in self.mechanisms if isinstance(term, BoneSprings)]

    @cached_in_process
    def section_mesh(self) -> SectionMesh:
        """The mesh of the section, fine under the cylinder."""
        if self.meshed is not None:
            return self.meshed
        indenter = self.indenter
        return mesh_section(self.section, indenter.radius, indenter.aim, indenter.direction, *self._meshed_by)

    @property
    def _meshed_by(self) -> tuple[SectionMeshSettings, MPI.Intracomm, bool, bool]:
        """What the mesh of a section under an indenter depends on: how fine it is, and what moves by itself in it."""
        return self.settings.mesh, self.comm, bool(self._springs), bool(self.model.at("face"))

    @cached_in_process
    def _moving(self) -> dict[str, tuple[FloatArray, ...]]:
        """By a motion's name, those of nodes, of the skin's nodes and of the outline (n, 3), mm."""
        spaces, meshed, section = self.system.spaces, self.section_mesh, self.section

        def moving(motion: MeshMotion | LateralPlacement, at: FloatArray) -> FloatArray:
            if isinstance(motion, LateralPlacement):
                # The skin's elements go with the cylinder, so that the derivative is free of what each does that comes
                # into contact. A travel that is turned takes it the farther the deeper: as at the usual depth's middle.
                aside = motion.offset_mm + math.radians(motion.tilt_deg) * 0.5 * self.indenter.radius
                motion = MeshMotion("skin", width=_SLIDES_MM, size=aside, along=True)
            return motion.displacement(at[:, :2].copy(), section, meshed.touch, meshed.direction)

        places = spaces.mesh.geometry.x, spaces.skin.geometry.x, meshed.outline
        every = {name: [moving(motion, at) for at in places] for name, motion in self.motions.items()}
        return {name: tuple(np.pad(one, ((0, 0), (0, 1))) for one in found) for name, found in every.items()}

    def _shift(self, placement: LateralPlacement, name: str) -> Shift | None:
        """Return what is shifted with an error of an outline, or of the line of travel, about a placement."""
        if name not in self.motions:
            return None
        motion, (nodes, skin, outline) = self.motions[name], self._moving[name]
        aside = motion if isinstance(motion, LateralPlacement) else LateralPlacement()
        moved = 0.0 if aside is motion else outline[:, :2]
        ahead, behind = (
            LateralPlacement(placement.tilt_deg + way * aside.tilt_deg, placement.offset_mm + way * aside.offset_mm)
            for way in (1.0, -1.0)
        )
        start = 0.5 * (self._touch(ahead, moved) - self._touch(behind, -moved))
        direction = 0.5 * (ahead.travel(self.section_mesh.direction) - behind.travel(self.section_mesh.direction))
        return Shift(nodes, skin, start, direction, np.zeros(2) if aside is motion else start)

    def _touch(self, placement: LateralPlacement, moved: FloatArray | float = 0.0) -> FloatArray:
        """Return the cylinder's centre at first touch (mm) of the outline, or of one that is moved."""
        meshed, given = self.section_mesh, self.indenter
        aim = placement.aim(given.aim, meshed.direction)
        return first_touch(meshed.outline + moved, given.radius, aim, meshed.direction)

    @cached_in_process
    def replays(self) -> indentation.RecentSolutions:
        """Solutions whose states are kept."""
        return indentation.RecentSolutions()

    @cached_in_process
    def _well_integrated(self) -> "PlaneStrainIndentation":
        """The same test with more quadrature points, for thin layers of tissue that are stretched far."""
        degree = max(self.settings.quadrature_degree, _RAISED_DEGREE)
        return self.on_same_mesh(settings=replace(self.settings, defences=False, quadrature_degree=degree))

    @cached_in_process
    def _of_displacements(self) -> "PlaneStrainIndentation":
        """The same test with displacements alone as unknowns, in which thin layers of soft fat are more stable."""
        return self.on_same_mesh(settings=replace(self.settings, defences=False, formulation="displacement"))

    def on_same_mesh(self, **changed: Any) -> "PlaneStrainIndentation":
        """Return the test with other fields, on this one's mesh where that serves it too."""
        made = replace(self, **changed, meshed=None)
        return replace(made, meshed=self.section_mesh) if made._meshed_by == self._meshed_by else made

    def attempts(self, placement: LateralPlacement | None = None) -> Iterator[indentation.Attempt]:
        """Yield the model, then with more quadrature points, without pressures, and with a softer contact."""
        placement = placement or LateralPlacement()
        placed = self._placed(placement)
        if not self.settings.defences:
            yield indentation.Attempt(placed)
            return
        mixed = self.settings.formulation == "mixed" and not self.system.faces
        # Skin that moves as two points of integration don't feel would creep to more of the same.
        yield indentation.Attempt(placed if mixed else placed.relaxing)
        if mixed:
            yield indentation.Attempt(self._well_integrated._placed(placement).relaxing, more_points=True)
            # An incompressible body is too stiff without pressures: `_trusted` asks.
            other = self._of_displacements._placed(placement).relaxing
            yield indentation.Attempt(other, without_pressures=True)
        yield indentation.Attempt(placed, indentation.SOFTER)

    def solve(
        self,
        values: Mapping[str, float] | None = None,
        protocol: Protocol | float | None = 30.0,
        sensitivities: Sequence[str] = (),
        *,
        depth: float | None = None,
        on_step: indentation.OnStep | None = None,
        keep_in: Path | None = None,
        placement: LateralPlacement | None = None,
    ) -> Solved:
        """Move the cylinder along a protocol.

        Parameters
        ----------
        values, protocol, sensitivities, depth, on_step, keep_in
            As those of `IndentationTest.solve`.
        placement
            Deviation of the cylinder's line of travel from the stated one; none by default.

        Returns
        -------
        Solved
            Also where the end wasn't reached.
        """
        given, attempts = as_protocol(protocol if depth is None else depth), self.attempts(placement)
        return self._farthest(attempts, indentation.IndentationRequest(values, given, sensitivities, on_step, keep_in))

    def _trusted(self, made: Iterator[Solved]) -> Iterator[Solved]:
        """Yield attempts; one without pressures counts only if its force agrees with the first attempt's."""
        first = next(made)
        if first.report.complete:
            yield first
            return
        where = self._most_stretched()
        yield _with_location(first, where)
        spent = first.report.factorisations
        while spent < _MOST_WORK and (solved := next(made, None)) is not None:
            report = solved.report
            spent += report.factorisations
            apart = _relative_difference(first.curve, solved.curve) if report.without_pressures else 0.0
            if apart > _SAME_FORCE:
                reason = f"without pressures the force is off by {100 * apart:.2g} %"
                refused = replace(report, complete=False, reached=0.0, reason=reason)
                yield replace(solved, report=refused)
            else:
                yield solved if report.complete else _with_location(solved, where)

    def _most_stretched(self) -> str:
        """Return a message: where the body is stretched most as the solution stops, and what to do about it."""
        found = most_stretched(self.system)
        tissue = next(name for name, tag in section_regions(self.section).items() if tag == found.region)
        x, y = found.place
        text = f"the {tissue} tissue is drawn out {found.stretch:.2g} times at ({x:.0f}, {y:.0f}) mm"
        near = ((self.section.polygon(bone).distance(Point(x, y)), bone) for bone in self.section.bones)
        gap, bone = min(near, default=(math.inf, ""))
        if tissue not in ("superficial", "fascia") and gap < _NEAR_MM:
            text += f", {gap:.0f} mm from the {bone}, onto which what lies above presses it"
        return f"{text}; use less depth, or check how soft it is beside its neighbours"

    def _made(self) -> indentation.IndentationModel:
        meshed, free = self.section_mesh, bool(self._springs)
        spaces = build_spaces(
            *meshed.tagged,
            self.settings.formulation,
            regions=self._regions | (bone_regions(self.section) if free else {}),
            supports=[Support(tag, (0, 1)) for tag in ((PLATE,) if free else (BONE, PLATE))],
            drained=[SKIN] if self.settings.drained_skin else [],
        )
        degree = self.settings.quadrature_degree
        faces = [SlidingForces(spaces, term) for term in self.model.at("face") if isinstance(term, SlidingFace)]
        system = System(spaces, self.model, meshed.touch, meshed.direction, degree, faces=faces)
        return indentation.IndentationModel(
            system,
            NewtonSolver(system, self.settings.newton),
            self.settings.contact,
            self.indenter.radius,
            self.indenter.length,
            # Faces that slide fail at many steps on their way.
            replace(self.settings.steps, smallest=0.02, most_astray=math.inf) if faces else self.settings.steps,
            self._reader(system, meshed),
        )

    def _reader(self, system: System, meshed: SectionMesh) -> ChannelReader:
        return ChannelReader(system, files_of("2d"), self.sights, TravelLine(meshed.touch, meshed.direction))

    def _placed(self, placement: LateralPlacement) -> indentation.IndentationModel:
        system = self.system
        system.start, system.direction = self._touch(placement), placement.travel(self.section_mesh.direction)
        system.shift_named = partial(self._shift, placement)
        return self.pressing


def _with_location(solved: Solved, where: str) -> Solved:
    """Return the outcome with the location added to its reason."""
    report = solved.report
    return replace(solved, report=replace(report, reason=f"{report.reason}: {where}"))


def _relative_difference(first: ForceCurve, other: ForceCurve) -> float:
    """Return the greatest relative difference of two curves in the second half of the depth that both reach."""
    depth = min(first.depth, other.depth)
    if depth <= 0:
        return math.inf
    at = np.linspace(0.5, 1.0, 11) * depth
    return float(np.abs(other(at) / first(at) - 1).max())

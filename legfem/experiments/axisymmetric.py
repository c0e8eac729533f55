"""Tests with axial symmetry: a ball on a layer, a cylinder between plates, of one tissue or bonded layers; one halfway.

Plates that rub let a specimen's ends slide by less than free ones, and by more than bonded ones. With Coulomb's
friction the force of a cylinder 1.7 times as wide as high lies between: at 10 % of strain, of the way from free to
bonded ends, 0.17 for a coefficient of 0.1, 0.38 for 0.2, 0.61 for 0.3 and 0.93 for 0.5. Solutions with friction stop at
a third of the height.
"""

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, ClassVar, Literal, Self

import numpy as np
from mpi4py import MPI

from legfem.channels.kinds import files_of
from legfem.channels.log import ChannelReader
from legfem.channels.seen import SeenSpecimen
from legfem.common.errors import AboveZero, Checked, InputError
from legfem.experiments.bodies import BallOnLayer, CylinderBetweenPlates, Faces
from legfem.experiments.experiment import Picklable, Solved
from legfem.experiments.indentation import Attempt, IndentationModel, IndentationRequest, IndentationTest, leg_model
from legfem.fem.spaces import LegSpaces, Symmetry, build_spaces
from legfem.fem.system import System
from legfem.mechanics.contact import ContactSettings
from legfem.mechanics.indenters import RigidBall, RigidIndenter, RigidPlate
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.model import Formulation, LegModel, Term
from legfem.meshing.grid import Support, TaggedMesh
from legfem.meshing.section import DEEP
from legfem.meshing.structured import MeridianMeshSettings, mesh_meridian, supports
from legfem.solve.linear import LinearSettings
from legfem.solve.newton import NewtonSolver
from legfem.solve.path import Course, courses_of, each_course, with_courses
from legfem.solve.protocol import Protocol
from legfem.solve.settings import NewtonSettings, StepSettings


@dataclass(frozen=True)
class Layer(Checked):
    """One of several tissues on each other, bonded.

    Parameters
    ----------
    name : str
        Prefix of its parameters' names: ``fat.C10`` and so on.
    thickness : float
        mm.
    law : Hyperelastic
        Law of the tissue.
    called : str
        Name of the tissue for what sees it, where its parameters have another.
    """

    name: str
    thickness: AboveZero[float]
    law: Hyperelastic
    called: str = ""


@dataclass(frozen=True)
class AxisymmetricSettings:
    """Numerical settings; without a mesh or contact a test chooses its own."""

    mesh: MeridianMeshSettings | None = None
    contact: ContactSettings | None = None
    newton: NewtonSettings = field(default_factory=NewtonSettings)
    linear: LinearSettings = field(default_factory=LinearSettings)
    steps: StepSettings = field(default_factory=lambda: StepSettings(first=0.1, largest=0.5))
    formulation: Formulation = "mixed"


@dataclass(frozen=True)
class Arrangement:
    """Indenter, body and mesh of a test in the meridional half plane; lengths in mm."""

    indenter: RigidIndenter
    centre: float
    """Height of the indenter's centre at first touch."""
    contact: ContactSettings
    length: float
    """Length by which the contact's stiffness is scaled, mm."""
    held: tuple[Support, ...]
    radius: float
    """Radius of the body, mm."""
    height: float
    """Height of the body, mm."""
    fine: tuple[float, float]
    """Distances from the axis between which the mesh is fine."""
    mesh: MeridianMeshSettings
    side: Literal["skin", "free"] = "free"
    """Whether the body's side may be touched."""
    symmetry: Symmetry = "axial"
    """Axial symmetry, or plane strain, in which the axis is a mirror."""
    whole: float = 1.0
    """Ratio of the whole indenter's force to the model's."""


@dataclass(frozen=True, eq=False)
class AxisymmetricBody[Sizes]:
    """A body with axial symmetry, of one tissue or of layers.

    Parameters
    ----------
    test
        Sizes and faces.
    law
        Law of the tissue, whose parameters are named ``deep.C10`` and so on; or several layers from the
        base up, as thick together as the body is high.
    settings
        Numerical.
    comm
        Ranks that one solution is spread over.
    mechanisms
        Terms added to those of tissue and contact, each in place of one of its name if there is.
    """

    test: Sizes
    law: Hyperelastic | tuple[Layer, ...]
    settings: AxisymmetricSettings = field(default_factory=AxisymmetricSettings)
    comm: MPI.Intracomm = field(default_factory=lambda: MPI.COMM_SELF, repr=False)
    mechanisms: Sequence[Term] = ()

    def with_terms(self, terms: Sequence[Term]) -> Self:
        """Return the test with more terms."""
        return replace(self, mechanisms=(*self.mechanisms, *terms))

    @property
    def laws(self) -> Mapping[str, Hyperelastic]:
        """Laws of the tissues by region, from the base up; one is called as the leg's deep one."""
        if isinstance(self.law, tuple):
            return {layer.name: layer.law for layer in self.law}
        return {"deep": self.law}

    def interfaces_within(self, height: float) -> tuple[float, ...]:
        """Return the heights at which layers meet, above the base of a body so high (mm).

        Raises
        ------
        InputError
            If the layers aren't as thick together as the body is high.
        """
        if not isinstance(self.law, tuple):
            return ()
        tops = np.cumsum([layer.thickness for layer in self.law])
        if abs(tops[-1] - height) > 1e-9 * height:
            problem = f"{tops[-1]:g} mm together, and the body is {height:g} mm"
            raise InputError("layers", "thickness", problem, "give layers that fill it")
        return tuple(tops[:-1].tolist())

    def spaces_on(self, meshed: TaggedMesh, held: Sequence[Support], symmetry: Symmetry = "axial") -> LegSpaces:
        """Return the spaces of the body on its mesh."""
        return build_spaces(
            *meshed.tagged,
            self.settings.formulation,
            regions={name: DEEP + k for k, name in enumerate(self.laws)},
            supports=held,
            symmetry=symmetry,
        )


@dataclass(frozen=True, eq=False)
class AxisymmetricTest[Sizes](AxisymmetricBody[Sizes], IndentationTest):
    """A test with axial symmetry; solves for any parameters without meshing again.

    A subclass gives the ``arrangement``: indenter, body and mesh.
    """

    side_seen: ClassVar[bool] = False
    """Whether a specimen's side is seen, in place of its layers."""

    @property
    @abstractmethod
    def arrangement(self) -> Arrangement:
        """Indenter, body and mesh of the test."""

    @property
    def interfaces(self) -> tuple[float, ...]:
        """Heights at which layers meet, above the base (mm)."""
        return self.interfaces_within(self.arrangement.height)

    @cached_property
    def model(self) -> LegModel:
        """Mechanical model: the sum of its terms."""
        given, formulation = self.arrangement, self.settings.formulation
        return leg_model(self.laws, given.indenter, given.contact, formulation).with_terms(self.mechanisms)

    @property
    def _seen(self) -> SeenSpecimen | None:
        if self.side_seen:
            return SeenSpecimen(side=True)
        if not isinstance(self.law, tuple):
            return None
        heights = pairwise((0.0, *self.interfaces, self.arrangement.height))
        names = (layer.called or layer.name for layer in self.law)
        return SeenSpecimen(dict(zip(names, heights, strict=True)))

    def _made(self) -> IndentationModel:
        given, settings = self.arrangement, self.settings
        meshed = mesh_meridian(
            given.radius, given.height, given.fine, given.mesh, given.side, self.comm, self.interfaces
        )
        spaces = self.spaces_on(meshed, given.held, given.symmetry)
        start, direction = np.array([0.0, given.centre]), np.array([0.0, -1.0])
        system = System(spaces, self.model, start, direction)
        solver = NewtonSolver(system, settings.newton, settings.linear)
        contact = given.contact
        if isinstance(self.law, tuple):
            stiffnesses = (f"{name}.{key}" for name in self.laws for key in ("C10", "C20"))
            contact = replace(contact, stiffnesses=tuple(stiffnesses))
        seen = self._seen
        reader = None if seen is None else ChannelReader(system, files_of("specimen"), specimen=seen)
        return IndentationModel(system, solver, contact, given.length, given.whole, settings.steps, reader)


class BallIndentation(AxisymmetricTest[BallOnLayer]):
    """The ball's test; the mesh has elements of an eighth of the ball's radius under it."""

    @property
    def arrangement(self) -> Arrangement:
        """A ball above the layer."""
        test = self.test
        return Arrangement(
            RigidBall(test.ball_radius),
            test.thickness + test.ball_radius,
            self.settings.contact or ContactSettings(tangential=test.ball, stiffness=4000.0),
            test.ball_radius,
            supports(test.base),
            test.layer_radius,
            test.thickness,
            (0.0, 1.4 * test.ball_radius),
            self.settings.mesh or MeridianMeshSettings(test.ball_radius / 8),
        )


_TOUCHING = 2e-3
"""Share of the depth at which a return between plates ends."""


class CylinderCompression(AxisymmetricTest[CylinderBetweenPlates]):
    """The cylinder's test; the mesh is fine at the end face's edge.

    The upper half is meshed, so that its plate moves by half of the compression; displacements are
    those of the whole.
    """

    side_seen: ClassVar = True

    @property
    def arrangement(self) -> Arrangement:
        """A plate above the upper half."""
        test, half = self.test, self.test.height / 2
        # Flat on flat the pressure has no edge to resolve: the penalty may be as stiff as a wall.
        wall = ContactSettings(
            tangential="rough" if test.ends == "bonded" else "frictionless", stiffness=1e6, onset=1e-6 * half
        )
        return Arrangement(
            RigidPlate(),
            half,
            self.settings.contact or wall,
            half,
            supports("sliding"),
            test.radius,
            half,
            (test.radius, test.radius),
            self.settings.mesh or MeridianMeshSettings(half / 15, growth=0.2, far_size=half / 6),
            "skin",
        )

    def attempts(self) -> Iterator[Attempt]:
        """Yield the model; a softer contact wouldn't help flat faces."""
        yield Attempt(self.pressing)

    def _farthest(self, attempts: Iterator[Attempt], asked: IndentationRequest) -> Solved:
        whole = asked.protocol
        first, *then = whole.displacement
        # Faces that come apart all at once have no equilibrium to step to: a return ends just before.
        least = _TOUCHING * whole.depth
        half = Protocol(whole.time, tuple(d / 2 for d in (first, *(max(d, least) for d in then))))

        def told(at: float) -> None:
            if asked.on_step is not None:
                asked.on_step(2 * at)

        return _doubled(super()._farthest(attempts, replace(asked, protocol=half, on_step=told)))


def _doubled(solved: Solved) -> Solved:
    """Return the outcome with the displacement of both halves."""
    path, curve, report = solved.path, solved.curve, solved.report
    return Solved(
        solved.parameters,
        replace(curve, displacement=2 * curve.displacement),
        replace(path, displacement=2 * path.displacement),
        replace(report, reached=2 * report.reached, target=2 * report.target),
    )


@dataclass(frozen=True, eq=False)
class HalfwayTest(Picklable):
    """Two tests of one body; parameters are those of both.

    Parameters
    ----------
    one, other
        That bound it.
    """

    one: AxisymmetricTest[Any]
    other: AxisymmetricTest[Any]

    @property
    def parameters(self) -> dict[str, float]:
        """Every number of the model by full name."""
        return self.one.parameters

    def with_terms(self, terms: Sequence[Any]) -> Self:
        """Return the test with more terms."""
        return replace(self, one=self.one.with_terms(terms), other=self.other.with_terms(terms))

    def solve(
        self,
        values: Mapping[str, float] | None = None,
        protocol: Protocol | float | None = None,
        sensitivities: Sequence[str] = (),
    ) -> Solved:
        """Solve both; the outcome is complete as far as both are, along the steps of the one that came less far."""
        least, most = sorted(
            (test.solve(values, protocol, sensitivities) for test in (self.one, self.other)),
            key=lambda solved: solved.report.reached,
        )
        at = least.curve.displacement
        if len(at) < 2:
            return least
        other = each_course(courses_of(most.curve), lambda values: most.curve.interpolated(values, at))
        between: dict[str, Course] = {
            name: (0.5 * (one + other[name][0]), {p: 0.5 * (slope + other[name][1][p]) for p, slope in by.items()})
            for name, (one, by) in courses_of(least.curve).items()
        }
        return replace(least, curve=with_courses(least.curve, between))


_STEPS = 20
"""Steps to the depth of a shallow test."""
_ELEMENTS = 5
"""Elements across half of a shallow test's contact."""


def settings_to(depth: float) -> AxisymmetricSettings:
    """Return settings for a depth (mm)."""
    usual = AxisymmetricSettings()
    # The same ones at any stiffness: forces are compared and differentiated.
    steps = StepSettings.regular(
        first=min(usual.steps.first, depth / _STEPS), largest=min(usual.steps.largest, depth / 10)
    )
    # A shallow test's forces are of millinewtons, which the volume of large elements rounds.
    return replace(usual, steps=steps, newton=replace(usual.newton, absolute_tolerance=1e-10))


def onset_to(faces: Faces, depth: float) -> ContactSettings:
    """Return a contact that sets on well within a depth (mm)."""
    usual = ContactSettings(tangential=faces, stiffness=4000.0)
    return replace(usual, onset=min(usual.onset, 2e-3 * depth))


def round_indenter(radius: float, faces: Faces, depth: float, usual_size: float) -> AxisymmetricSettings:
    """Return settings for a round indenter: elements resolve the contact, its onset the depth (mm)."""
    size = min(usual_size, (radius * depth) ** 0.5 / _ELEMENTS)
    return replace(settings_to(depth), mesh=MeridianMeshSettings(size), contact=onset_to(faces, depth))

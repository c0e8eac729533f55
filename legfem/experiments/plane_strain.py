"""A cylinder pressed into a leg's cross-section in plane strain."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from mpi4py import MPI

from legfem.contact import RigidCylinder
from legfem.contact_settings import ContactSettings
from legfem.experiments.placement import Placement
from legfem.experiments.pressing import (
    SOFTER,
    Indentation,
    Pressing,
    farthest,
    leg_model,
)
from legfem.geometry.section import LegSection
from legfem.materials import Hyperelastic, NeoHookean, ReducedPolynomial
from legfem.meshing.section import (
    REGIONS,
    SKIN,
    SectionMesh,
    SectionMeshSettings,
    first_touch,
    mesh_section,
)
from legfem.model import LegModel, Term
from legfem.newton import NewtonSettings, NewtonSolver
from legfem.protocol import Protocol
from legfem.spaces import Formulation, build_spaces
from legfem.stepping import StepSettings
from legfem.subject import Indenter, Subject, TissueParameters
from legfem.system import System


@dataclass(frozen=True)
class Tissues:
    """The laws of the three tissues (MPa, 1/MPa)."""

    deep: Hyperelastic
    superficial: Hyperelastic
    fascia: Hyperelastic


@dataclass(frozen=True)
class PlaneStrainSettings:
    """Numerical settings; the defaults are those that the convergence study states errors for."""

    mesh: SectionMeshSettings = field(default_factory=SectionMeshSettings)
    contact: ContactSettings = field(default_factory=ContactSettings)
    newton: NewtonSettings = field(default_factory=NewtonSettings)
    steps: StepSettings = field(default_factory=StepSettings)
    formulation: Formulation = "mixed"
    drained_skin: bool = False
    """Whether the fat's fluid can leave through the skin, in a porous form."""
    quadrature_degree: int = 4
    defences: bool = True
    """Whether a softer contact and then a finer mesh are tried when a solution stops short."""


class PlaneStrainIndentation:
    """The plane-strain test on one section; solves for any parameters without meshing again.

    Parameters
    ----------
    section
        Of the leg.
    indenter
        Cylinder and line of travel; the force is that of its whole length.
    tissues
        Laws; their parameters are the defaults of `solve`.
    settings
        Numerical.
    comm
        Over which one solution is spread.
    mechanisms
        Terms added to those of tissues and contact, each in place of one of its name if there is.
    """

    def __init__(
        self,
        section: LegSection,
        indenter: Indenter,
        tissues: Tissues,
        settings: PlaneStrainSettings | None = None,
        comm: MPI.Intracomm = MPI.COMM_SELF,
        mechanisms: Sequence[Term] = (),
    ) -> None:
        self.section, self.indenter, self.tissues = section, indenter, tissues
        self.mechanisms = tuple(mechanisms)
        self.settings = settings or PlaneStrainSettings()
        self.comm = comm
        self.section_mesh: SectionMesh = mesh_section(
            section, indenter.radius, indenter.aim, indenter.direction, self.settings.mesh, comm
        )
        self.model = self._model()
        spaces = build_spaces(
            self.section_mesh.mesh,
            self.section_mesh.cell_tags,
            self.section_mesh.facet_tags,
            self.settings.formulation,
            drained=[SKIN] if self.settings.drained_skin else [],
        )
        self.system = System(
            spaces,
            self.model,
            self.section_mesh.touch,
            self.section_mesh.direction,
            self.settings.quadrature_degree,
        )
        self.solver = NewtonSolver(self.system, self.settings.newton)
        self._pressing = Pressing(
            self.system,
            self.solver,
            self.settings.contact,
            indenter.radius,
            indenter.length,
            self.settings.steps,
        )

    @classmethod
    def of_subject(
        cls,
        subject: Subject,
        settings: PlaneStrainSettings | None = None,
        comm: MPI.Intracomm = MPI.COMM_SELF,
        mechanisms: Sequence[Term] = (),
    ) -> PlaneStrainIndentation:
        """Return the test of a subject; the deep tissue's law covers both of the paper's."""
        tissues = tissues_of(subject)
        return cls(subject.section, subject.indenter, tissues, settings, comm, mechanisms)

    def solve(
        self,
        parameters: Mapping[str, float] | None = None,
        depth: float = 30.0,
        sensitivities: Sequence[str] = (),
        turns: Sequence[float] = (),
        on_step: Callable[[float], None] | None = None,
        placement: Placement | None = None,
    ) -> Indentation:
        """Press the cylinder in at 1 mm/s; tissues without memory don't know of the rate.

        Parameters
        ----------
        parameters
            Values that differ from the tissues' own, by full name (``deep.C10`` in MPa).
        depth
            Displacement to reach (mm).
        sensitivities
            Parameters to differentiate the force by.
        turns
            Displacements (mm) to go to after ``depth``, for unloading.
        on_step
            Called with the displacement (mm) of every accepted step.
        placement
            Where the cylinder really stood; as stated without it.

        Returns
        -------
        Indentation
            Also where the depth wasn't reached.
        """
        protocol = Protocol.through((depth, *turns), rate=1.0)
        return self.follow(protocol, parameters, sensitivities, on_step, placement)

    def follow(
        self,
        protocol: Protocol,
        parameters: Mapping[str, float] | None = None,
        sensitivities: Sequence[str] = (),
        on_step: Callable[[float], None] | None = None,
        placement: Placement | None = None,
    ) -> Indentation:
        """Move the cylinder along a protocol: loading, holds, unloading, at any rates.

        The other arguments and the outcome are those of `solve`.
        """
        placement = placement or Placement()
        asked = parameters, protocol, sensitivities, on_step
        self._place(placement)
        attempts = [self._pressing.run(*asked, softness=1.0)]
        if self.settings.defences and not attempts[-1].report.complete:
            attempts.append(self._pressing.run(*asked, softness=SOFTER))
        if self.settings.defences and not attempts[-1].report.complete:
            finer = PlaneStrainIndentation(
                self.section,
                self.indenter,
                self.tissues,
                replace(self.settings, mesh=self.settings.mesh.refined(1.5), defences=False),
                self.comm,
                self.mechanisms,
            )
            finer._place(placement)
            attempts.append(finer._pressing.run(*asked, softness=SOFTER))
        return farthest(attempts)

    def _place(self, placement: Placement) -> None:
        meshed, indenter = self.section_mesh, self.indenter
        aim = placement.aim(indenter.aim, meshed.direction)
        touch = first_touch(meshed.outline, indenter.radius, aim, meshed.direction)
        self.system.place_indenter(touch, placement.travel(meshed.direction))

    def _model(self) -> LegModel:
        tissues = {name: getattr(self.tissues, name) for name in REGIONS}
        cylinder = RigidCylinder(self.indenter.radius)
        model = leg_model(tissues, cylinder, self.settings.contact, self.settings.formulation)
        for term in self.mechanisms:
            model = model.with_term(term)
        return model


def tissues_of(subject: Subject) -> Tissues:
    """Return the laws of a subject's tissues; what is to be identified stands at 1 kPa.

    The deep tissue is a reduced polynomial: with ``C20 = 0`` and ``D2 = inf`` it is neo-Hookean.
    """
    given = subject.tissues
    deep = given["deep"]
    return Tissues(
        deep=ReducedPolynomial(
            C10=1e-3 if deep.C10 is None else deep.C10,
            D1=deep.D1,
            C20=deep.C20 or 0.0,
            D2=math.inf if deep.D2 is None else deep.D2,
        ),
        superficial=_law(given["superficial"]),
        fascia=_law(given["fascia"]),
    )


def _law(given: TissueParameters) -> Hyperelastic:
    if given.C10 is None:
        raise ValueError("only the deep tissue's stiffness is identified")
    if given.law == "neo-hookean":
        return NeoHookean(given.C10, given.D1)
    second = math.inf if given.D2 is None else given.D2
    return ReducedPolynomial(given.C10, given.D1, given.C20 or 0.0, second)

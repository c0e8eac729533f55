"""A leg's finite-element models: its section in plane strain, its shape in 3D, and with terms that show mechanisms."""

import math
import os
import pathlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from mpi4py import MPI

from legfem.channels.kinds import planned_sights
from legfem.experiments.experiment import Picklable, Solved, cached_in_process
from legfem.experiments.indenter_pose import Ball, Cylinder, LegIndenter, Pose, Punch
from legfem.experiments.leg_3d import LegIndentation3D, SolidLegSettings, membrane_of
from legfem.experiments.plane_strain import LateralPlacement, PlaneStrainIndentation, PlaneStrainSettings, Tissues
from legfem.geometry.indenter import Site
from legfem.geometry.motion import without_layer
from legfem.geometry.section import MUSCLE
from legfem.inverse.accuracy import MATERIAL_LOG_SD
from legfem.inverse.observations import Observations
from legfem.inverse.responses import SolvedResponses
from legfem.legs.nuisances import errors_of_geometry
from legfem.legs.placement import SpatialLeg
from legfem.legs.subject import Subject, TissueParameters
from legfem.mechanics.materials import Hyperelastic, NeoHookean, ReducedPolynomial
from legfem.mechanics.model import Term
from legfem.mechanics.terms import Fibres
from legfem.mechanisms import Solution, TissueMechanism, mechanisms, shown_in
from legfem.solve.protocol import Protocol

_CUT_OF_SLIP = 0.25
"""Of a step that failed: sliding fat folds suddenly, and long steps fail again."""


@dataclass(eq=False)
class LegVariants(Picklable):
    """A leg's finite-element models, meshed and compiled when first asked for.

    Parameters
    ----------
    base
        The leg as it is pressed, without any mechanism.
    """

    base: PlaneStrainIndentation

    @cached_in_process
    def _models(self) -> dict[str, PlaneStrainIndentation]:
        return {}

    @cached_in_process
    def _described(self) -> dict[str, str]:
        return {}

    @property
    def assumed(self) -> tuple[str, ...]:
        """Full names of the numbers that are assumed, and may be somewhat off."""
        return tuple(name for name in MATERIAL_LOG_SD if name in self.base.model.parameters)

    @property
    def geometric(self) -> tuple[str, ...]:
        """Names of errors of outlines, aim and direction."""
        return tuple(self.base.motions)

    def follow(
        self, protocol: Protocol, deep: Mapping[str, float], solution: Solution, sensitivities: Sequence[str] = ()
    ) -> Solved:
        """Solve a protocol.

        Parameters
        ----------
        protocol
            The indenter's path.
        deep
            ``deep.C10`` and so on, MPa.
        solution
            The mechanism.
        sensitivities
            Parameters and errors of the geometry to differentiate by.
        """
        model = self.model(solution.variant)
        values = solution.values(deep, model.model.parameters)
        return model.solve(values, protocol, sensitivities, placement=LateralPlacement(solution.tilt_deg))

    def parameters(self, variant: str) -> dict[str, float]:
        """Return a model's parameters by full name (MPa, 1/MPa)."""
        return self.model(variant).model.parameters

    def described(self, variant: str) -> str:
        """Return what tells a model from others: its terms and settings."""
        if variant not in self._described:
            self._described[variant] = repr((self._terms(variant), self._settings(variant)))
        return self._described[variant]

    def model(self, variant: str) -> PlaneStrainIndentation:
        """Return a model by its name."""
        if variant not in self._models:
            settings, terms = self._settings(variant), self._terms(variant)
            self._models[variant] = self.base.on_same_mesh(settings=settings, mechanisms=terms)
        return self._models[variant]

    def _settings(self, variant: str) -> PlaneStrainSettings:
        settings = self.base.settings
        for mechanism in shown_in(variant):
            if mechanism.formulation is not None:
                settings = replace(settings, formulation=mechanism.formulation)
            if mechanism.tangential is not None:
                contact = replace(settings.contact, tangential=mechanism.tangential)
                settings = replace(settings, contact=contact)
            if mechanism.tangential == "frictionless":
                # Contact that remembers nothing bears steps that hang on the work they are.
                steps = replace(settings.steps, easy=4, hard=7, cut=_CUT_OF_SLIP)
                settings = replace(settings, steps=steps)
        for other in mechanisms():
            if isinstance(other, TissueMechanism) and variant in (other.variant, other.null_variant):
                contact, onset = settings.contact, other.contact_onset or settings.contact.onset
                contact = replace(contact, stiffness=other.contact_softness * contact.stiffness, onset=onset)
                settings = replace(settings, contact=contact)
        return settings

    def _terms(self, variant: str) -> list[Any]:
        return [term for m in shown_in(variant, self.base.section) for term in m.terms(self.base)]


_DEPTH_STEP_MM = 1.0
COARSENING = 1.7
"""Of the mesh on which relative changes are tabulated."""
_LONG = replace(PlaneStrainSettings().steps, largest=3.0, growth=1.4, curve_tolerance=0.01)
"""Steps on that mesh: some 18 for 30, and the force from 5 mm on as near 1e-3 to that by very short ones as with 30."""
_TOLERANCES = 1e-6, 1e-5
"""Of Newton's method, over the contact's forces, on the default mesh and on that: the force is then exact to that
share of it, and a curve takes a fifth fewer iterations than with the default."""


def library_folder() -> pathlib.Path:
    """Return the folder that keeps all legs' responses."""
    cache = os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache"
    return pathlib.Path(cache) / "legfem" / "responses"


def solved_responses(
    subject: Subject, observed: Observations, folder: pathlib.Path | None
) -> tuple[SolvedResponses, SolvedResponses]:
    """Return a leg's responses by full solutions, on the default mesh, and on a coarser one in longer steps.

    Elastic curves go to the next mm beyond the recordings, so that recordings of one leg share
    them whatever their depths. Of kinds that aren't recorded they have the places that plans look at, where a kept
    solution has them: that is no part of a solution's key, as nothing else hangs on it.
    """
    depth = _DEPTH_STEP_MM * -(-(observed.depth + 0.3) // _DEPTH_STEP_MM)
    default = PlaneStrainSettings()
    fine, coarse = (replace(default, newton=replace(default.newton, relative_tolerance=one)) for one in _TOLERANCES)
    coarse = replace(coarse, mesh=default.mesh.refined(1 / COARSENING), steps=_LONG)
    # A plan weighs what could be seen, too: reading it costs no solution.
    planned = planned_sights(Site(subject.section, subject.indenter), [one.name for one in subject.sights])

    def responses(settings: PlaneStrainSettings) -> SolvedResponses:
        # Muscles are deep tissue, and known by name to what acts in them.
        test = replace(plane_strain_test(subject.with_muscles(()), settings), section=subject.section)
        test = replace(test, motions=errors_of_geometry(subject.section.bones, subject.section.layers))
        variants = LegVariants(replace(test, sights=(*subject.sights, *planned)))
        depends_on = {**test.fingerprint(), "model": "plane strain with mechanisms", "depth_mm": depth}
        return SolvedResponses(variants, depth, folder, depends_on)

    return responses(fine), responses(coarse)


def tissues_of(subject: Subject) -> Tissues:
    """Return the laws of a subject's tissues; what is to be identified stands at 1 kPa.

    The deep tissue is a reduced polynomial: with ``C20 = 0`` and ``D2 = inf`` it is neo-Hookean.
    """
    given = subject.tissues
    deep = given["deep"]
    law = _polynomial(deep, 1e-3 if deep.C10 is None else deep.C10)
    muscles, alone = dict.fromkeys(subject.muscles, law), MUSCLE in subject.section.lacks
    fat, fascia = (law if alone else _law(given[name]) for name in ("superficial", "fascia"))
    return Tissues(law, fat, fascia, muscles, alone)


def _law(given: TissueParameters) -> Hyperelastic:
    if given.C10 is None:
        raise ValueError("only the deep tissue's stiffness is identified")
    if given.law == "neo-hookean":
        return NeoHookean(given.C10, given.D1)
    return _polynomial(given, given.C10)


def _polynomial(given: TissueParameters, c10: float) -> ReducedPolynomial:
    return ReducedPolynomial(c10, given.D1, given.C20 or 0.0, math.inf if given.D2 is None else given.D2)


def plane_strain_test(
    subject: Subject, settings: PlaneStrainSettings | None = None, mechanisms: Sequence[Term] = ()
) -> PlaneStrainIndentation:
    """Return the cylinder pressed into a subject's section; the deep tissue's law covers both of the paper's."""
    own = [one for name in subject.muscles for one in subject.section.muscles_of(name)]
    section = replace(subject.section, muscles={one: subject.section.muscles[one] for one in own})
    given = section, subject.indenter, tissues_of(subject), settings or PlaneStrainSettings()
    return PlaneStrainIndentation(*given, mechanisms=mechanisms, sights=subject.sights)


def spatial_test(
    subject: Subject, leg: SpatialLeg, settings: SolidLegSettings | None = None, comm: MPI.Intracomm = MPI.COMM_SELF
) -> LegIndentation3D:
    """Return the indenter pressed into a subject's leg in 3D; see `legfem.legs.placement.spatial_leg`.

    The fascia's layer has no thickness here, and between soft tissues it doesn't yield across
    it: it is taken out of the leg, so that fat and muscle are as thick as they are.
    """
    given, tissues, fibres, section = subject.indenter, tissues_of(subject), subject.fibres, subject.section
    aim = float(given.aim[0]), float(given.aim[1])
    indenter: LegIndenter = Ball(given.radius)
    if given.shape != "ball":
        indenter = (Punch if given.shape == "punch" else Cylinder)(given.radius, given.length)
    muscle = {"deep": tissues.deep, **tissues.muscles}
    return LegIndentation3D(
        without_layer(leg.shape, section.fascia_thickness),
        indenter,
        Pose(aim, 0.0, given.direction_deg, given.axis_deg),
        {**muscle, "superficial": tissues.superficial},
        membrane_of(tissues.fascia, section.fascia_thickness),
        settings or SolidLegSettings(),
        comm,
        () if fibres is None else tuple(Fibres.of_ratio(one, law.C10, fibres.value) for one, law in muscle.items()),
        {name: tuple(map(section.contour, section.muscles_of(name))) for name in subject.muscles},
    )

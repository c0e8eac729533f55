"""The plane-strain model as identification sees it, values in and a curve or a failure out; the deep tissue's laws."""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from legfem.common.errors import Argument, InputError, Remedy
from legfem.experiments.indentation import SolutionStates
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings, Tissues
from legfem.inverse import catalogue
from legfem.inverse.elastography import elastography_priors
from legfem.inverse.outcome import Outcome
from legfem.inverse.parameter import Parameter, Prior
from legfem.inverse.readings import INSTRUMENT
from legfem.legs.finite_element_models import plane_strain_test
from legfem.legs.subject import Subject


@dataclass(eq=False)
class PlaneStrainForward:
    """The plane-strain test of a subject; meshes on the first solve, in whichever process."""

    experiment: PlaneStrainIndentation
    """Compiled and meshed when first solved."""
    depth: float
    """mm."""

    @classmethod
    def of_subject(
        cls, subject: Subject, depth: float, settings: PlaneStrainSettings | None = None
    ) -> "PlaneStrainForward":
        """Return the test of a subject pressed to a depth (mm).

        Raises
        ------
        InputError
            For a ball, a punch or a cylinder that doesn't lie along the leg.
        """
        subject.indenter.check_lies_along(str(subject.directory / "subject.toml"))
        return cls(plane_strain_test(subject, settings), depth)

    def prepare(self) -> None:
        """Compile and mesh now."""
        _ = self.experiment.pressing

    @property
    def nominal(self) -> catalogue.Values:
        """The tissues' values, and those of further mechanisms (MPa, 1/MPa)."""
        further = {k: v for term in self.experiment.mechanisms for k, v in term.parameters.items()}
        return {**values_of(self.experiment.tissues), **further}

    def solve(self, values: catalogue.Values, sensitivities: Sequence[str]) -> Outcome:
        """Solve in full."""
        replay = SolutionStates(self.experiment, dict(values), self.depth)
        solved = self.experiment.solve(values, self.depth, sensitivities, on_step=replay.take)
        replay.solved = solved
        self.experiment.replays.add(replay)
        return Outcome.of(values, solved.curve, solved.report)

    def fingerprint(self) -> Mapping[str, Any]:
        """Return section, indenter, tissues, settings, places of channels, depth and code."""
        return {"model": "plane strain", "depth_mm": self.depth, **self.experiment.fingerprint()}


def values_of(tissues: Tissues) -> dict[str, float]:
    """Return the tissues' values by full name (MPa, 1/MPa)."""
    laws = {"deep": tissues.deep, **tissues.laws}
    return {f"{tissue}.{key}": value for tissue, law in laws.items() for key, value in law.parameters.items()}


def default_parameters(nominal: catalogue.Values) -> tuple[Parameter, ...]:
    """Return C10 and C20 of the deep tissue; a law takes what it has."""
    return tuple(catalogue.parameter_of(name, nominal) for name in (catalogue.DEEP_C10, catalogue.DEEP_C20))


def law_of(
    name: catalogue.LawName,
    subject: Subject,
    nominal: catalogue.Values,
    parameters: Sequence[Parameter] | None = None,
    fixed: catalogue.Values | None = None,
) -> catalogue.IdentifiedLaw:
    """Return a law with what the subject's folder assumes.

    Parameters
    ----------
    name : str
        Of the law.
    subject : Subject
        Whose deep tissue it is.
    nominal : Mapping[str, float]
        The model's values as assumed.
    parameters : sequence of Parameter, optional
        Free ones, of which the law takes those that it has, and those of role "fixed" not; C10 and
        C20 of the deep tissue without them. What elastography of the subject says of a stiffness,
        and the folder of its fibres' ratio, is its prior unless it has one.
    fixed : Mapping[str, float], optional
        Held in place of the assumed values.

    Raises
    ------
    InputError
        For a name that the model hasn't, or a stiffness that is neither free nor given.
    """
    given = default_parameters(nominal) if parameters is None else parameters
    held = dict(fixed or {})
    given = _with_what_is_known(given, subject, nominal)
    catalogue.check_known([one.name for one in given], nominal, Argument("identify"))
    catalogue.check_known(list(held), nominal, Argument("fix"))
    muscle, plain, own = ("deep", *subject.muscles), name == "neo-hookean", dict[str, float | None]()
    without = [f"{tissue}.{key}" for tissue in muscle for key in ("C20", "D2")] if plain else []
    free = tuple(
        catalogue.within_prior(one)
        for one in sorted(given, key=lambda one: one.name in INSTRUMENT)
        if one.role != "fixed" and one.name not in (*without, *held)
    )
    if not free:
        raise InputError(Argument("identify"), name, "nothing is left to identify", "name a parameter")
    held = {key: value for key, value in held.items() if key not in without}
    for tissue in muscle:
        law = subject.tissues[tissue]
        c20, d2 = (0.0, math.inf) if plain else (law.C20, law.D2 or math.inf)
        own |= {f"{tissue}.C10": law.C10, f"{tissue}.C20": c20, f"{tissue}.D2": d2}
    names = {one.name for one in free}
    for key, value in own.items():
        if key in names or key in held:
            continue
        if value is None:
            remedy = Remedy("add ", Argument("identify", key), ", or ", Argument("fix", f"{key}=VALUE kPa"))
            raise InputError(Argument("identify"), key, f"is neither identified nor given for the {name} law", remedy)
        held[key] = value
    return catalogue.IdentifiedLaw(name, free, held, nominal)


def _with_what_is_known(given: Sequence[Parameter], subject: Subject, nominal: catalogue.Values) -> list[Parameter]:
    """Return parameters with what was measured of them, and what was measured of others."""
    known = {one.name: one for one in given}
    priors, fibres = elastography_priors(subject.elastography), subject.fibres
    if catalogue.DEEP_RATIO in nominal and fibres is not None and fibres.sd:
        priors[catalogue.DEEP_RATIO] = Prior(fibres.value, fibres.sd, "linear", fibres.source)
    if subject.stiffness_prior is not None:
        priors.setdefault(catalogue.DEEP_C10, subject.stiffness_prior)
    for name, prior in priors.items():
        own = known.get(name) or replace(catalogue.parameter_of(name, nominal), role="nuisance")
        known[name] = replace(own, prior=own.prior or prior)
    return list(known.values())


def laws_of(
    subject: Subject,
    names: Sequence[catalogue.LawName],
    nominal: catalogue.Values,
    parameters: Sequence[Parameter] | None = None,
    fixed: catalogue.Values | None = None,
) -> dict[catalogue.LawName, catalogue.IdentifiedLaw]:
    """Return the laws asked for, and the neo-Hookean one if it is the limit of another.

    Raises
    ------
    InputError
        For a name that the model hasn't, or a stiffness that is neither free nor given.
    """
    laws = {name: law_of(name, subject, nominal, parameters, fixed) for name in names}
    stiffening = any(law.index(catalogue.DEEP_C20) is not None for law in laws.values())
    if stiffening and "neo-hookean" not in laws:
        with suppress(InputError):
            laws["neo-hookean"] = law_of("neo-hookean", subject, nominal, parameters, fixed)
    return laws

"""What a mechanism is to the diagnosis.

A mechanism acts in one or several of these ways, each of which vanishes at its parameters' nulls:
it changes the tissue or the contact (then a finite-element solution tells its response), where the
indenter stands, how stiff the deep tissue is at a time or in a trial, or what the load cell says.
"""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.advice import LabStep, left
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter, Prior, Scale

if TYPE_CHECKING:
    from legfem.experiments.plane_strain import Tissues
    from legfem.geometry.indenter import Indenter, Site
    from legfem.geometry.section import LegSection
    from legfem.mechanics.contact import TangentialName
    from legfem.mechanics.materials import Hyperelastic
    from legfem.mechanics.model import Formulation

Values = Mapping[str, float]
type Stiffness = tuple[float, float]
"""C10 and C20 of the deep tissue, MPa."""


class IndentedLeg(Protocol):
    """A leg and how it is pressed: what a mechanism's terms may ask of it."""

    @property
    def section(self) -> "LegSection":
        """Across the leg."""

    @property
    def indenter(self) -> "Indenter":
        """Its size, aim and direction."""

    @property
    def tissues(self) -> "Tissues":
        """The base model's laws."""


def strength(
    name: str,
    unit: str,
    statement: str,
    usual: float,
    bounds: tuple[float, float],
    source: str = "a size that would matter",
) -> Parameter:
    """Return a mechanism's first parameter: null at zero, of a usual size."""
    return Parameter(name, unit, bounds, Prior(0.0, usual, "linear", source), statement=statement)


def factor(name: str, statement: str, bounds: tuple[float, float], log_sd: float, source: str) -> Parameter:
    """Return a mechanism's first parameter that multiplies something: null at one."""
    prior = Prior(1.0, log_sd, "log", source)
    return Parameter(name, "-", bounds, prior, scale="log", statement=statement)


def shape(name: str, unit: str, statement: str, prior: Prior, bounds: tuple[float, float]) -> Parameter:
    """Return a mechanism's further parameter, searched on the scale of what is known of it."""
    scale: Scale = "log" if prior.scale == "log" else "linear"
    return Parameter(name, unit, bounds, prior, scale=scale, statement=statement)


def error_mode(name: str, statement: str, source: str) -> Parameter:
    """Return a parameter that counts standard deviations of what a table or a correction errs by."""
    return shape(name, "sd", statement, Prior(0.0, 1.0, "linear", source), (-3.0, 3.0))


@dataclass(frozen=True)
class Occurrence:
    """Which strengths of a mechanism anatomy and rigs allow, and how common the great ones are.

    Parameters
    ----------
    low, high
        Between which it lies, in its unit.
    strong
        Share of those that lie anywhere between them, evenly in what its prior is normal in; the others
        are as usual: as its prior says.
    source
        Where that is known from; empty where nobody has counted.
    always
        Between which it lies, evenly, in every body, whether recordings can show it or not; None of what may be absent.
    """

    low: float
    high: float
    strong: float = 0.0
    source: str = ""
    always: tuple[float, float] | None = None


@dataclass(frozen=True)
class Mechanism:
    """A mechanism that does nothing: what others override.

    The first parameter is the strength; at the centre of its prior, its null, the others have no
    effect.
    """

    name: ClassVar[str]
    statement: ClassVar[str]
    """What was left out, as a sentence with no formula."""
    parameters: ClassVar[tuple[Parameter, ...]]
    """Each with a prior."""
    next_experiment: ClassVar[str]
    """The measurement that would settle it."""
    steps: ClassVar[tuple[LabStep, ...]] = ()
    """The same as steps of which each serves, where recordings may show that one was taken."""
    measured_sd: ClassVar[float | None] = None
    """How well that measures the strength by itself, without the indenter: standard deviation in
    its unit, or of a factor's logarithm; None where it doesn't."""
    would_be: ClassVar[str] = ""
    """What its strength is in a sentence, which stands at ``{}``: "fat of {} times the stiffness"."""
    expected: ClassVar[float] = 1.0
    """How often it is there, over the other mechanisms, before anything was recorded."""
    kin: ClassVar[str] = ""
    """What is sure where one of several mechanisms is there that do much the same, as a sentence; theirs alone."""
    stands_for_C20: ClassVar[bool] = False
    """Whether its strength is C20 itself where the base law has none, which then is its response."""
    unseen_statement: ClassVar[str] = ""
    """What every body has of it that recordings don't show, as a sentence without its full stop; see `Unseen`."""
    hides_in_stiffness: ClassVar[bool] = False
    """Whether a refit of the stiffness takes up nearly all that it does, so that even recordings of it hardly tell."""
    scaled: ClassVar[tuple[str, ...]] = ()
    """Full names of the assumed numbers that its strength multiplies."""
    needs: ClassVar[str] = ""
    """What a limb must have for it: ``muscle``, ``bones``."""
    of_pad: ClassVar[str] = ""
    """Its statement in a limb without muscle, where it isn't the same."""
    alters_nuisances: ClassVar[bool] = False
    """Whether outlines, aim, direction and what is assumed that are off do something else beside it than without it."""

    @property
    def strength_name(self) -> str:
        """Full name of its first parameter, the strength."""
        return f"{self.name}.{self.parameters[0].name}"

    def by_full_name(self, values: Values) -> dict[str, float]:
        """Return values of its parameters by their full names."""
        return {f"{self.name}.{name}": value for name, value in values.items()}

    def untestable(self, observed: Observations) -> str | None:
        """Return why such recordings can't show it, or None."""
        return None

    def unseen_factors(self, between: tuple[float, float], observed: Observations) -> FloatArray:
        """Return factors (k,) on the deep stiffness, equally probable, in recordings that don't show it.

        Its strength lies evenly between two ends.
        """
        return np.ones(1)

    def experiment_after(self, observed: Observations) -> str:
        """Return the measurement that would settle it beside what was recorded; empty where all that helps was."""
        return ", or ".join(left(observed, *self.steps)) if self.steps else self.next_experiment

    def acts_in(self, values: Values, site: "Site") -> tuple[FloatArray, float] | None:
        """Return the middle (2,) and the radius, mm, of where in the section it acts; None of no one place."""
        return None

    def in_limb(self, section: "LegSection") -> "Sequence[Mechanism]":
        """Return what there is of it in a limb."""
        return (self,)

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return values that searches begin at: the misfit may have several minima."""
        first, *rest = self.parameters
        others = {p.name: null_of(p) for p in rest}
        ends = [first.inside(value_at(first, z)) for z in (-0.5, 0.5)]
        distinct = [v for v in ends if abs(v - null_of(first)) > 1e-9 * abs(ends[1])]
        return tuple({first.name: value, **others} for value in distinct)

    def restated(self, **stated: Any) -> Self:
        """Return the same mechanism of another body than a leg, with its words and its usual sizes by attribute."""
        found = copy(self)
        for name, value in stated.items():
            object.__setattr__(found, name, value)
        return found

    def for_length(self, values: Values, factor: float) -> Values:
        """Return its values with an indenter that is ``factor`` times as long."""
        return values

    def relative_change(self, values: Values, at: Stiffness, observed: Observations) -> FloatArray | None:
        """Return what it adds to the elastic force, over that (n,); None where it leaves the tissue as it is.

        Of a mechanism without finite-element solutions it is one of every force on the cylinder.
        """
        return None

    def displacement_loss(self, values: Values, observed: Observations, force: FloatArray) -> FloatArray:
        """Return what the tissue is pressed less than the sensor says (n,), mm."""
        return np.zeros(len(force))

    def deep_factor(self, values: Values, observed: Observations) -> FloatArray:
        """Return the factor on the deep tissue's stiffness (n,)."""
        return np.ones(len(observed.force))

    def force_factor(self, values: Values, observed: Observations) -> FloatArray:
        """Return the factor on the force (n,), and on every other force on the cylinder."""
        return np.ones(len(observed.force))

    def added_force(self, values: Values, observed: Observations) -> FloatArray:
        """Return what is added to the force (n,), N."""
        return np.zeros(len(observed.force))


@dataclass(frozen=True)
class Unseen:
    """What is always there, that recordings don't show and explanations leave out which don't name it."""

    mechanism: Mechanism
    factors: tuple[float, ...]
    """On the deep stiffness, equally probable."""


def shown_mechanisms(
    mechanisms: Sequence[Mechanism], observed: Observations, ruled_out: Mapping[str, str]
) -> tuple[list[Mechanism], dict[str, str]]:
    """Return the mechanisms that recordings can show, and by name why they can't show the others.

    Parameters
    ----------
    mechanisms
        All that the body may have.
    observed
        The recordings.
    ruled_out
        Reasons by name why a mechanism isn't missing from the base model.
    """
    why = {m.name: ruled_out.get(m.name) or m.untestable(observed) for m in mechanisms}
    unable = {name: reason for name, reason in why.items() if reason is not None}
    return [m for m in mechanisms if m.name not in unable], unable


def prior_of(parameter: Parameter) -> Prior:
    """Return a mechanism's parameter's prior."""
    assert parameter.prior is not None, f"{parameter.name} has no prior"
    return parameter.prior


def null_of(parameter: Parameter) -> float:
    """Return where a strength does nothing: the centre of its prior."""
    return prior_of(parameter).centre


def value_at(parameter: Parameter, departure: float) -> float:
    """Return a value so many standard deviations from the null."""
    return prior_of(parameter).value_at(departure)


@dataclass(frozen=True)
class Solution:
    """What finite-element solution shows a mechanism at given values."""

    variant: str = "elastic"
    """Which model: the base with the terms of all mechanisms of that variant."""
    parameters: Values = field(default_factory=dict)
    """Changed parameters of that model by full name (MPa, 1/MPa, mm4/(N s), s)."""
    scaled: Values = field(default_factory=dict)
    """Factors on parameters of the base model, by full name."""
    tilt_deg: float = 0.0
    """Tilt of the indenter's travel, degrees."""
    null: str = "elastic"
    """The variant without the mechanism that it is compared with: its own error cancels."""
    null_in_series: float = 0.0
    """Compliance (mm/N) of springs that this one is in series with."""

    def joined(self, other: "Solution") -> "Solution | None":
        """Return the solution with what both change of a model that shows both; None where there is none."""
        of_base = [{one.variant, one.null} == {"elastic"} for one in (self, other)]
        # Other models than the base one show it, too, where it changes numbers or the travel that all have.
        of_any = [base and not one.parameters for base, one in zip(of_base, (self, other), strict=True)]
        if not (all(of_base) or any(of_any)):
            return None
        model = self if of_any[1] else other
        return replace(
            model,
            parameters={**self.parameters, **other.parameters},
            scaled={**self.scaled, **other.scaled},
            tilt_deg=self.tilt_deg + other.tilt_deg,
        )

    def values(self, deep: Mapping[str, float], nominal: Mapping[str, float]) -> dict[str, float]:
        """Return what to solve the model with, by full name.

        Parameters
        ----------
        deep
            The deep tissue's numbers, ``deep.C10`` and so on (MPa).
        nominal
            Those of the model as it is made, which factors multiply where ``deep`` doesn't have them.
        """
        scaled = {name: factor * deep.get(name, nominal[name]) for name, factor in self.scaled.items()}
        return {**deep, **scaled, **self.parameters}


@dataclass(frozen=True)
class TissueMechanism(Mechanism):
    """A mechanism whose response only a finite-element solution tells."""

    variant: ClassVar[str] = "elastic"
    """Variant of the leg's model; mechanisms of one variant share a mesh and its forms."""
    formulation: "ClassVar[Formulation | None]" = None
    """Formulation of the variant, where it isn't the base model's."""
    tangential: "ClassVar[TangentialName | None]" = None
    """Law of contact along the surface, likewise."""
    contact_softness: ClassVar[float] = 1.0
    """Factor on the contact's stiffness in that variant, and in its `null_variant`, ..."""
    contact_onset: ClassVar[float | None] = None
    """... and the gap (mm) at which its pressure starts there, where it isn't the base model's."""
    null_variant: ClassVar[str] = "elastic"
    """The one that its solution is compared with."""
    along_path: ClassVar[bool] = False
    """Whether the response depends on time or history, not on displacement alone."""
    strengths: ClassVar[tuple[float, ...]] = ()
    """Where the response is tabulated, beside the null."""
    does_without: ClassVar[bool] = False
    """Whether it acts in other ways, too, so that it stays where its solutions stop."""

    @property
    def derivatives(self) -> tuple[str, ...]:
        """Parameters of its model by which the response is tabulated, in place of strengths.

        They are zero at the mechanism's null, and the response is their derivatives there, times
        `shares`.
        """
        return ()

    @property
    def derived_together(self) -> tuple[str, ...]:
        """Those of all mechanisms that one solution of its variant, at their nulls, gives at once."""
        return self.derivatives

    @property
    def nodes(self) -> tuple[Values, ...]:
        """Values far from the null at which it is solved, too, where it is tabulated by derivatives.

        What those miss there is tabulated after them, and has a share of its own.
        """
        return ()

    def tabulated(self, values: Values) -> float:
        """Return the strength at which the response is looked up, and ..."""
        return values[self.parameters[0].name]

    def share(self, values: Values) -> float:
        """... return how much of that response there is."""
        return 1.0

    def shares(self, values: Values) -> FloatArray:
        """Return what each of the derivatives, and what they miss at each of the nodes, is multiplied by (k,)."""
        raise NotImplementedError(f"{self.name} isn't tabulated by derivatives")

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the terms that it adds to the leg's model, at their nulls."""
        return ()

    def terms_of(self, law: "Hyperelastic") -> Sequence[Any]:
        """Return those that it adds to a body of one tissue, called deep."""
        return ()

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return the usual strengths and the ends of the tabulated ones."""
        ends = sorted({min(self.strengths), max(self.strengths)}) if self.strengths else []
        others = {p.name: null_of(p) for p in self.parameters[1:]}
        first = self.parameters[0].name
        return (*super().starts(observed), *({first: end, **others} for end in ends))

    def solution(self, values: Values) -> Solution:
        """Return the solution that shows the mechanism at values: the model with those numbers scaled, by itself."""
        if not self.scaled:
            raise NotImplementedError(f"{self.name} doesn't say which solution shows it")
        return Solution(scaled=dict.fromkeys(self.scaled, values[self.parameters[0].name]))

"""What was found of a problem, one result for every kind of test; its notices, and which of several laws is asked for.

What only one kind has (a leg's sites in 3D, a specimen's layers, the pressures in a stocking) is in ``details``, of
that kind's type.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import chdtrc
from scipy.stats import chi2, norm

from legfem.common.documents import versions_of
from legfem.common.units import FloatArray
from legfem.data.recording import Origin
from legfem.inverse.answer import Answer, Finding, FitNotice, Notice, Tone, Value, leading
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, LawName, Values, model_values
from legfem.inverse.comparison import Weighting
from legfem.inverse.estimates import Estimate, Shown
from legfem.inverse.intervals import VERDICTS, Identifiability
from legfem.inverse.readings import READINGS, Channel
from legfem.inverse.trial import SearchLog

LEAST_CHANCE = 1e-3
"""Probability of so large a misfit, were the law right, below which the law is doubted."""


@dataclass(frozen=True)
class Identity:
    """What was tested: a leg, or a folder of specimens."""

    id: str
    title: str
    origin: Origin
    """``measured``, ``reconstructed`` or ``simulated``."""
    directory: Path | None = None
    """Folder that was given."""


@dataclass(frozen=True)
class Goodness:
    """A sum of squares over its errors, and the probability of one as large."""

    chi_square: float
    degrees_of_freedom: int
    p_value: float

    @classmethod
    def of(cls, chi_square: float, degrees: int) -> "Goodness":
        """Goodness of a sum of squares with its degrees of freedom."""
        return cls(chi_square, degrees, float(chi2.sf(chi_square, degrees)))

    @property
    def fits(self) -> bool:
        """Whether so large a misfit isn't unusual."""
        return not self.p_value < LEAST_CHANCE

    @property
    def birge_ratio(self) -> float:
        """Factor on the errors that would make the misfit usual; 1 at least.

        R. T. Birge, Phys. Rev. 40 (1932) 207; the Particle Data Group's scale factor.
        """
        if self.degrees_of_freedom == 0:
            return 1.0
        return float(np.sqrt(max(self.chi_square / self.degrees_of_freedom, 1.0)))


EXACT = Goodness(0.0, 0, 1.0)
"""Goodness of a single test, which nothing can disagree with."""
UNTESTED = Goodness(0.0, 0, math.nan)
"""Goodness of a model that was compared with nothing."""


@dataclass(frozen=True)
class Cost:
    """Plain sum of squares at the optimum (Eq. 12), and what the search minimised."""

    value: float = 0.0
    """Sum of squared differences, model less recording, over the first channel's readings and those of its unit."""
    points: int = 0
    """Number of differences in the sum."""
    per_length: float = math.nan
    """Sum with forces per unit length of the cylinder, (N/mm)2; NaN where there is none."""
    r_squared: float = math.nan
    """Share of the readings' variance that is predicted."""
    minimised: str = "nothing"
    """What the search minimised, in words."""
    minimised_value: float = math.nan
    minimised_unit: str = "1"
    definition: str = "sum over the displacement grid of (F_simulated - F_measured)^2, Eq. 12"
    reading_unit: str = "N"
    """Unit of the readings, whose square is that of the sum."""

    @property
    def unit(self) -> str:
        """Unit of the sum: N2."""
        return f"{self.reading_unit}2"

    @property
    def mean_square(self) -> float:
        """Mean squared difference; NaN of no readings."""
        return self.value / self.points if self.points else math.nan

    @property
    def rms(self) -> float:
        """Root mean square difference, in the readings' unit."""
        return math.sqrt(self.mean_square)


@dataclass(frozen=True)
class OwnEstimate:
    """A parameter as one test alone has it, in the model's unit.

    From the solves of the joint fit, without further ones; a fit of that test by itself has an interval of its own.
    """

    value: float
    standard_error: float
    departure: float
    """Difference from the joint value, in standard errors of that difference."""


@dataclass(frozen=True)
class Computed(Shown):
    """A quantity that follows from a fit; its error and interval are NaN where they aren't known."""

    name: str
    """In words: ``pressure on the skin, mean``."""


@dataclass(frozen=True, eq=False)
class ChannelFit:
    """Readings of one channel beside the fit."""

    channel: Channel
    predicted: FloatArray
    """Predicted readings (n,), in the channel's unit."""
    sensitivities: Mapping[str, FloatArray] = field(default_factory=dict)
    """Derivatives (n,) by parameters, by full name, per unit of the parameter."""

    @property
    def residual(self) -> FloatArray:
        """Model less recording, (n,)."""
        return self.predicted - self.channel.values

    @property
    def rms(self) -> float:
        """Root mean square of the residual."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def farthest_at(self) -> float:
        """Station at which model and recording are farthest apart: a displacement, mm, or a time, s."""
        return float(self.channel.station[np.argmax(np.abs(self.residual))])

    @property
    def r_squared(self) -> float:
        """Share of the readings' variance that is predicted."""
        return r_squared(float(np.sum(self.residual**2)), self.channel.values)


@dataclass(frozen=True, eq=False)
class TestFit:
    """One test beside the fit."""

    __test__ = False  # pytest's

    name: str
    """What people call it."""
    channels: tuple[ChannelFit, ...]
    goodness: Goodness
    """Goodness of this test's differences alone, with as many degrees of freedom as readings."""
    fitted: bool = True
    """Else it was left out, and is predicted."""
    by_itself: Mapping[str, OwnEstimate] = field(default_factory=dict)
    """Parameters as this test alone has them, by full name; empty where there is one test."""

    @property
    def force(self) -> ChannelFit:
        """The first channel: the force along the travel, where one was recorded."""
        return self.channels[0]


class KindDetails:
    """What one kind of problem has: its answer, and what it adds to ``result.json``; unless overridden, nothing."""

    def answer(self, fit: Any) -> Answer:
        """Return the answer of the fit that has these details."""
        return answer_of(fit)

    def chosen(self, fits: "Sequence[Fit[Any]]") -> "Fit[Any]":
        """Return the law's fit whose answer is that of all."""
        return preferred(fits)

    def members(self, fit: Any) -> Mapping[str, Any]:
        """Return members of a law."""
        return {}

    def members_of_test(self, fit: Any, number: int) -> Mapping[str, Any]:
        """Return members of one of a law's tests."""
        return {}


@dataclass(frozen=True, eq=False, kw_only=True)
class Fit[Details: KindDetails]:
    """One law fitted to all tests of a problem; defaults are those of a model that was compared with nothing."""

    kind: str
    """``leg``, ``specimens`` or ``stocking``."""
    subject: Identity
    law: LawName
    estimates: Mapping[str, Estimate] = field(default_factory=dict)
    """What was free, by full name (``deep.C10``)."""
    correlations: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    """Correlations of the estimates' errors, (p, p), in their order."""
    values: Values
    """All that the optimum was solved with, free and held, in the model's units."""
    assumed: Values
    """What of model and instrument was held; finite numbers in the model's units."""
    goodness: Goodness = UNTESTED
    """Goodness of all differences with their covariance, and of priors."""
    cost: Cost
    agreement: Goodness = EXACT
    """Agreement of what the tests say by themselves, were the parameters the same at all; its Birge ratio widens the
    errors that tests have of their own, and so the intervals. `EXACT` of one test."""
    tests: tuple[TestFit, ...] = ()
    log: SearchLog
    neo_hookean_limit: bool = False
    """Whether the optimum of a law with C20 is its neo-Hookean limit."""
    weighting: Weighting = "covariance"
    settings: Mapping[str, Any]
    """Numbers that the fit depends on, their units in the names."""
    versions: Mapping[str, str]
    details: Details
    """What only this kind of problem has."""
    notices: tuple[Notice, ...] = ()
    """What a reader must know: what is unlikely in the input or the result, then the others, the gravest first."""
    computed: Mapping[str, Computed] = field(default_factory=dict)
    """What else is asked of this kind of problem, by key (``pressure_on_skin``)."""

    @property
    def answer(self) -> Answer:
        """What the fit says, as its kind has it."""
        return self.details.answer(self)

    @property
    def asked(self) -> Mapping[str, Estimate]:
        """What was to be identified, by full name: the deep tissue's C10, and what isn't there for its prior alone."""
        every = self.estimates.items()
        return {name: one for name, one in every if name == DEEP_C10 or one.parameter.role == "identified"}

    @property
    def apart(self) -> tuple[str, ...]:
        """Tests that by themselves have another value of a parameter, beyond chance among all (95 %)."""
        away = [abs(own.departure) for one in self.tests for own in one.by_itself.values()]
        most = float(norm.isf(0.025 / max(len(away), 1)))
        return tuple(one.name for one in self.tests if any(abs(o.departure) > most for o in one.by_itself.values()))

    @property
    def doubts(self) -> int:
        """How many of what was given, or came out, are unlikely, and move C10 by more than its half-width.

        Where the law misses the recordings, which widens that, or where C10 isn't determined, each may be why.
        """
        c10 = self.estimates.get(DEEP_C10)
        return leading(self.notices, c10.relative_half_width if c10 and c10.one_number and self.goodness.fits else 0.0)

    @property
    def identifiability(self) -> Identifiability | None:
        """The worst verdict on what was asked for; None where nothing was."""
        return max((one.identifiability for one in self.asked.values()), key=VERDICTS.index, default=None)

    @property
    def model_values(self) -> dict[str, float]:
        """What to solve the model with to see the optimum (MPa, 1/MPa, mm)."""
        return model_values(self.values)

    def correlation(self, one: str, other: str) -> float:
        """Correlation of two parameters' errors; NaN where one wasn't free."""
        names = list(self.estimates)
        if one not in names or other not in names:
            return float(np.nan)
        return float(self.correlations[names.index(one), names.index(other)])

    def farthest(self, name: str) -> TestFit:
        """The test that by itself departs most from the joint value of a parameter."""
        return max(self.tests, key=lambda one: abs(one.by_itself[name].departure))


def answer_of(fit: Fit[Any], limited: bool = False, **parameters: Any) -> Answer:
    """Return what a fit says, by its goodness, its tests' agreement and the estimates' identifiability.

    Parameters
    ----------
    fit
        The fit.
    limited
        Whether what only its kind knows limits it.
    **parameters
        What the kind's words need besides.
    """
    finding = Finding.TESTS_DISAGREE if not fit.agreement.fits else Finding.FITS
    finding = finding if fit.goodness.fits or finding is not Finding.FITS else Finding.MISFIT
    known = all(one.identifiability == "identifiable" for one in fit.asked.values()) and not (limited or fit.apart)
    tone: Tone = "wrong" if finding is not Finding.FITS else "sound" if known else "caution"
    values = {name: value_of(one) for name, one in fit.estimates.items()}
    told = {"law": fit.law, "tests": len(fit.tests), "fitted": sum(one.fitted for one in fit.tests), **parameters}
    return Answer(fit.kind, finding, tone, values, doubts=fit.doubts, parameters=told)


def value_of(found: Estimate) -> Value:
    """Return an estimate as an answer has it."""
    shown, asked = found.shown, found.parameter.role == "identified"
    ends = None if found.undetermined else shown.ci95
    return Value(ends, shown.unit, shown.value, shown.standard_error, asked=asked, at_bound=found.at_bound)


def r_squared(squares: float, values: FloatArray) -> float:
    """Coefficient of determination of a sum of squared differences from values (n,)."""
    return 1 - float(squares / np.sum((values - values.mean()) ** 2))


def versions() -> dict[str, str]:
    """Versions of legfem and of what a fit rests on."""
    return versions_of("legfem", "dolfinx", "numpy", "scipy", "pygad", "python")


_FAR = 3.0
"""Standard deviations from a prior's centre that chance doesn't explain."""


def of_search(log: SearchLog) -> Iterator[Notice]:
    """Say that a search ended too early, if it did."""
    if not log.converged:
        yield Notice.of(FitNotice.UNCONVERGED)


def of_compromise(log: SearchLog) -> Iterator[Notice]:
    """Say what the best solve's model gave up to go on, if anything."""
    if log.compromise:
        yield Notice.of(FitNotice.COMPROMISE, by=log.compromise)


def of_failed_solves(log: SearchLog, reach: str = "") -> Iterator[Notice]:
    """Say how many full solves stopped short of a reach in words, where, and why."""
    if log.failed_solves:
        failed = [one for one in log.solves if not one.complete]
        yield Notice.of(
            FitNotice.SOLVES_STOPPED,
            stopped=log.failed_solves,
            solves=log.forward_solves,
            reach=reach,
            C10=tuple(one.values[DEEP_C10] for one in failed if DEEP_C10 in one.values),
            reason=failed[0].reason if failed else "",
        )


def at_limits(fit: Fit[Any]) -> Iterator[Notice]:
    """Say which parameters stand at a bound of the search."""
    for name, one in fit.estimates.items():
        # What acts in closed form may have its null at a bound, and no effect is no limit.
        bound = one.parameter.bounds[0 if one.at_bound == "lower" else 1]
        none = name in READINGS and bound == READINGS[name].null
        if one.at_bound and not none and not (name == DEEP_C20 and fit.neo_hookean_limit):
            yield Notice.of(FitNotice.AT_BOUND, name=name, bound=one.at_bound)
    if fit.law == "reduced-polynomial" and fit.neo_hookean_limit:
        yield Notice.of(FitNotice.NEO_HOOKEAN_LIMIT)


def far_from_priors(estimates: Mapping[str, Estimate]) -> Iterator[Notice]:
    """Say which parameters the recordings put far from what was known beforehand."""
    for name, one in estimates.items():
        prior = one.parameter.prior
        if prior is not None and abs(departure := prior.departure(one.value)) > _FAR:
            yield Notice.of(FitNotice.FAR_FROM_PRIOR, name=name, departure=abs(departure))


SIGNIFICANT = 0.01
"""Chance below which it doesn't explain what a further parameter gains."""


def preferred(results: Sequence[Fit[Any]]) -> Fit[Any]:
    """Return the law that the data ask for: the better fit, unless chance explains that it is."""
    better, *others = sorted(results, key=misfit_of)
    if not others:
        return better
    fewer = len(better.estimates) > len(others[0].estimates)
    by_chance = fewer and gain_of(better, others[0])[1] >= SIGNIFICANT
    return others[0] if by_chance or better.neo_hookean_limit else better


def gain_of(better: Fit[Any], worse: Fit[Any]) -> tuple[float, float]:
    """Return by how much chi-square falls with further parameters, and the chance of that."""
    gain = worse.goodness.chi_square - better.goodness.chi_square
    extra = len(better.estimates) - len(worse.estimates)
    return gain, float(chdtrc(extra, gain)) if gain > 0 else 1.0


def misfit_of(result: Fit[Any]) -> float:
    """What laws are compared by: the cost that was minimised, without priors."""
    return result.cost.value if result.weighting == "paper" else result.goodness.chi_square


def least_akaike[Details: KindDetails](fits: Sequence[Fit[Details]]) -> Fit[Details]:
    """Law that fits best for the number of its parameters (Akaike's criterion)."""
    return min(fits, key=lambda one: one.goodness.chi_square + 2 * len(one.estimates))

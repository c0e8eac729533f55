"""What was found of a problem: one result for every kind of test, and how it is made of a search.

A `Problem` has tests, a model of all of them and unknowns by law; `fit` searches for the unknowns and returns a `Fit`
for each law. What only one kind has (a leg's sites in 3D, a specimen's layers) is in ``details``, of that kind's type.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, is_dataclass
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np
from scipy.stats import chi2

from legfem.common.documents import versions_of
from legfem.common.errors import Doubt
from legfem.common.units import FloatArray, readable_unit
from legfem.inverse.catalogue import (
    DEEP_C20,
    IdentifiedLaw,
    LawName,
    Values,
    key_of,
    model_values,
    short_key_of,
    unit_suffix,
    with_units,
)
from legfem.inverse.comparison import Comparison, Covariances, JointComparison, Weighting, total_of
from legfem.inverse.data import Channel, Data
from legfem.inverse.estimates import Estimate, Optimum, correlations_of, estimates
from legfem.inverse.form_error import NO_DEPARTURE, PartDeparture, departure_of
from legfem.inverse.intervals import VERDICTS, Identifiability
from legfem.inverse.outcome import Forward, FullSolver
from legfem.inverse.search import Search
from legfem.inverse.searches import Found, Searches
from legfem.inverse.settings import IdentificationSettings, SearchRequest
from legfem.inverse.trial import CostMap, FullSolve, SearchLog, Trial

LEAST_CHANCE = 1e-3
"""Probability of so large a misfit, were the law right, below which the law is doubted."""
_MAP_SIZE = 81


@dataclass(frozen=True)
class Identity:
    """What was tested: a leg, or a folder of specimens."""

    id: str
    title: str
    origin: str
    """``measured``, ``reconstructed`` or ``simulated``."""


@dataclass(frozen=True)
class Goodness:
    """A sum of squares over its errors, and the probability of one as large."""

    chi_square: float
    degrees_of_freedom: int
    p_value: float

    @classmethod
    def of(cls, chi_square: float, degrees: int) -> Goodness:
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
"""Of nothing that could disagree."""


@dataclass(frozen=True)
class Cost:
    """Plain sum of squares at the optimum (Eq. 12), and what the search minimised."""

    value: float
    """Sum of squared differences, model less recording, over all readings, N2."""
    points: int
    """Number of differences in the sum."""
    per_length: float
    """Sum with forces per unit length of the cylinder, (N/mm)2; NaN where there is none."""
    r_squared: float
    """Share of the readings' variance that is predicted."""
    minimised: str
    """What the search minimised, in words."""
    minimised_value: float
    minimised_unit: str
    definition: str = "sum over the displacement grid of (F_simulated - F_measured)^2, Eq. 12"

    @property
    def mean_square(self) -> float:
        """Mean squared difference, N2."""
        return self.value / self.points

    @property
    def rms(self) -> float:
        """Root mean square difference, N."""
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
    def r_squared(self) -> float:
        """Share of the readings' variance that is predicted."""
        return r_squared(float(np.sum(self.residual**2)), self.channel.values)


class Measured(Protocol):
    """A test as its result has it."""

    @property
    def name(self) -> str:
        """What people call it."""
        ...

    @property
    def data(self) -> Data:
        """Channels of readings."""
        ...


@dataclass(frozen=True, eq=False)
class TestFit:
    """One test beside the fit."""

    __test__ = False  # pytest's

    test: Measured
    channels: tuple[ChannelFit, ...]
    goodness: Goodness
    """Of this test's differences alone, with as many degrees of freedom as readings."""
    fitted: bool = True
    """Else it was left out, and is predicted."""
    by_itself: Mapping[str, OwnEstimate] = field(default_factory=dict)
    """Parameters as this test alone has them, by full name; empty where there is one test."""

    @property
    def name(self) -> str:
        """What people call the test."""
        return self.test.name

    @property
    def force(self) -> ChannelFit:
        """The first channel."""
        return self.channels[0]


@dataclass(frozen=True, eq=False, kw_only=True)
class Fit[Details]:
    """One law fitted to all tests of a problem."""

    kind: str
    """``leg`` or ``specimens``."""
    subject: Identity
    law: LawName
    estimates: Mapping[str, Estimate]
    """What was free, by full name (``deep.C10``)."""
    correlations: FloatArray
    """Correlations of the estimates' errors, (p, p), in their order."""
    values: Values
    """All that the optimum was solved with, free and held, in the model's units."""
    assumed: Values
    """What of model and instrument was held; finite numbers in the model's units."""
    goodness: Goodness
    """Of all differences with their covariance, and of priors."""
    cost: Cost
    agreement: Goodness
    """Of what the tests say by themselves, were the parameters the same at all; its Birge ratio widens the errors that
    tests have of their own, and so the intervals. `EXACT` of one test."""
    tests: tuple[TestFit, ...]
    log: SearchLog
    neo_hookean_limit: bool
    """Whether the optimum of a law with C20 is its neo-Hookean limit."""
    weighting: Weighting
    settings: Mapping[str, Any]
    """Numbers that the fit depends on, their units in the names."""
    versions: Mapping[str, str]
    details: Details
    """What only this kind of problem has."""
    warnings: tuple[str, ...] = ()
    """One sentence each, the gravest first."""
    doubts: tuple[Doubt, ...] = ()
    """What is unlikely in the input, or in what came out of it."""

    @property
    def identifiability(self) -> tuple[Identifiability, str]:
        """The worst of the parameters' verdicts, and the reasons for each."""
        worst = max(self.estimates.values(), key=lambda one: VERDICTS.index(one.identifiability))
        return worst.identifiability, "; ".join(
            f"{key_of(name)}: {one.identifiability}: {one.why}" for name, one in self.estimates.items()
        )

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


class Problem[C: Comparison](Protocol):
    """Tests, a model of all of them, and what is unknown: all that a fit needs."""

    @property
    def forward(self) -> Forward:
        """Model of all tests: one curve a test in every outcome."""
        ...

    @property
    def unknowns(self) -> Mapping[LawName, IdentifiedLaw]:
        """What is free and held in each law."""
        ...

    def comparison(self, law: IdentifiedLaw, near: tuple[Values, FloatArray] | None = None) -> C:
        """Predictions beside the readings; with ``near`` shared errors count in the weights about that solve."""
        ...

    @property
    def sensitivities(self) -> tuple[str, ...]:
        """Full names of the model's parameters that solves are differentiated by."""
        ...

    @property
    def weighs_shared_errors(self) -> bool:
        """Whether errors that tests share are weighed against what was known beforehand."""
        ...

    def refined(self, search: Search[C]) -> C | None:
        """Comparison made anew about what a search found, to search again; None where it stays as it is."""
        ...

    def assessed(self, found: Found[C]) -> Fit[Any]:
        """Result of a finished search."""
        ...


def fit[C: Comparison](problem: Problem[C], laws: Sequence[LawName], request: SearchRequest) -> list[Fit[Any]]:
    """Fit laws to all tests of a problem together.

    Parameters
    ----------
    problem
        Tests and unknowns.
    laws
        Names, all among the problem's unknowns.
    request
        Means of the search: settings, folder for kept solves, processes, progress.

    Raises
    ------
    InputError
        If the model can't be meshed.
    SearchError
        If too few full solves come as far as what was measured.
    """
    with request.solver(problem.forward, problem.sensitivities, len(problem.unknowns)) as solver:
        return fit_with(problem, laws, solver, request.settings)


def fit_with[C: Comparison](
    problem: Problem[C], laws: Sequence[LawName], solver: FullSolver, settings: IdentificationSettings
) -> list[Fit[Any]]:
    """`fit` with a solver that is at hand; see there."""
    near = None
    if problem.weighs_shared_errors:
        near = Searches(problem.unknowns, solver, settings, problem.comparison).nearest(laws)
    searches = Searches(
        problem.unknowns, solver, settings, lambda law: problem.comparison(law, near), refined=problem.refined
    )
    return [problem.assessed(found) for found in searches.find(laws)]


def r_squared(squares: float, values: FloatArray) -> float:
    """Coefficient of determination of a sum of squared differences from values (n,)."""
    return 1 - float(squares / np.sum((values - values.mean()) ** 2))


def goodness_of(
    found: Found[Any], covariance: FloatArray, expected: FloatArray | None = None, lost: int = 0
) -> Goodness:
    """Goodness of a law where it misses least in the readings' errors, priors included.

    Parameters
    ----------
    found
        The finished search.
    covariance
        (n, n): of measured less predicted readings.
    expected
        (n,): readings to be met, in place of the measured ones.
    lost
        Degrees of freedom that were spent on other things than the law's parameters.
    """
    left, departures = found.linear.nearest(covariance, expected)
    chi_square = float(left @ np.linalg.solve(covariance, left) + departures @ departures)
    return Goodness.of(chi_square, len(left) + len(departures) - len(found.search.law.parameters) - lost)


def optimum_of(
    found: Found[Any], covariances: Covariances, times: float, goodness: Goodness, assumed: Values, plane: bool
) -> tuple[Mapping[str, Estimate], FloatArray]:
    """Estimates and their correlations (p, p) at the optimum.

    Parameters
    ----------
    found
        The finished search.
    covariances
        Errors of the readings by source, from which intervals are drawn.
    times
        Standard errors in half a 95 % interval.
    goodness
        Of the fit.
    assumed
        Stiffnesses that were held, whose effect is stated.
    plane
        Whether the model is a section of a leg, which has no ends.
    """
    departure = NO_DEPARTURE if goodness.fits else _departure(found, covariances)
    optimum = Optimum(found.linear, found.residual, covariances, times, goodness.fits, assumed, plane, departure)
    return MappingProxyType(estimates(optimum)), correlations_of(optimum.spread)


def _departure(found: Found[Any], covariances: Covariances) -> PartDeparture:
    """What the law's misfit may do to a stiffness, beyond errors of readings and of the model's numbers."""
    comparison = found.search.misfit
    errors = total_of({source: covariances[source] for source in ("recordings", "model") if source in covariances})
    return departure_of(comparison.parts_along, comparison.measured, found.linear.prediction.values, errors)


def cost_of(found: Found[Any], per_length: float = math.nan) -> Cost:
    """Plain sum of squares at the optimum."""
    search, best = found.search, found.best
    comparison, law = search.misfit, search.law
    value = float(comparison.cost(found.linear.prediction.values))
    measured = comparison.of_force(comparison.measured)
    weighting = weighting_used(comparison)
    minimised = {
        "paper": "the sum itself (Eq. 12)",
        "covariance": "the sum weighted with the inverse covariance (dimensionless)",
    }[weighting]
    return Cost(
        value=value,
        points=len(measured),
        per_length=per_length,
        r_squared=r_squared(value, measured),
        minimised=minimised + (", and the priors' squared departures" if len(law.priors) else ""),
        minimised_value=best.objective,
        minimised_unit="N2" if weighting == "paper" else "1",
    )


def weighting_used(comparison: Comparison) -> Weighting:
    """What the search minimised."""
    return comparison.weighting if isinstance(comparison, JointComparison) else "covariance"


def log_of(found: Found[Any]) -> SearchLog:
    """Course of a finished search."""
    search = found.search
    outcomes = found.outcomes
    return SearchLog(
        names=search.law.names,
        solves=tuple(_full_solve(trial, search) for trial in found.trials),
        generations=tuple(search.generations),
        cost_map=_cost_map(search),
        converged=search.converged,
        seed=search.settings.seed,
        wall_s=found.wall_s,
        emulator_error=search.emulator_error,
        forward_solves=len(outcomes),
        failed_solves=sum(not one.complete for one in outcomes),
        reused_solves=found.reused_solves,
        factorisations=sum(one.factorisations for one in outcomes),
        compromise=found.best.outcome.compromise,
    )


def _full_solve(trial: Trial, search: Search[Any]) -> FullSolve:
    outcome = trial.outcome
    cost = math.nan if trial.prediction is None else float(search.misfit.cost(trial.prediction.values))
    return FullSolve(
        MappingProxyType(dict(trial.values)),
        cost,
        trial.stage,
        outcome.complete,
        outcome.reason,
        outcome.factorisations,
        outcome.seconds,
    )


def _cost_map(search: Search[Any]) -> CostMap | None:
    """Cost over the region that was solved in, of one or two parameters."""
    law, domain = search.law, search.domain
    if not search.settings.emulator or len(law.names) > 2:
        return None
    solved = np.array([trial.point for trial in search.complete])
    low, high = solved.min(axis=0), solved.max(axis=0)
    axes = []
    for k, parameter in enumerate(law.parameters):
        if parameter.name.endswith("C10") and parameter.scale == "log":
            axes.append(np.geomspace(0.7 * low[k], 1.4 * high[k], _MAP_SIZE))
            continue
        ends = domain.genes(np.array([low, high]))[:, k]
        if np.ptp(ends) == 0:
            ends = np.array([0.0, 1.0])
        genes = np.zeros((_MAP_SIZE, len(law.names)))
        genes[:, k] = np.linspace(float(ends[0]), float(ends[1]), _MAP_SIZE)
        axes.append(domain.values(genes)[:, k])
    across, up = axes if len(axes) == 2 else (axes[0], np.zeros(1))
    points = np.stack(np.meshgrid(across, up), axis=-1)[..., : len(law.names)]
    return CostMap(law.names, across, up, search.emulated().cost(points))


def held_values(law: IdentifiedLaw) -> Values:
    """Numbers that were held, in the model's units; none where a term is absent (C20 of 0, D2 infinite)."""
    return MappingProxyType(
        {
            name: value
            for name, value in {**law.nominal, **law.fixed}.items()
            if name not in law.names and math.isfinite(value) and (name, value) != (DEEP_C20, 0.0)
        }
    )


def search_settings(search: Search[Any]) -> dict[str, Any]:
    """Numbers that a search depends on, their units in the names."""
    law, settings = search.law, search.settings
    minimiser = settings.minimiser if settings.emulator else settings.plain_minimiser
    bounds = {}
    for parameter in law.parameters:
        unit, factor = readable_unit(parameter.unit)
        bounds[f"{short_key_of(parameter.name)}_bounds_{unit_suffix(unit)}"] = [
            factor * end for end in parameter.bounds
        ]
    return {
        **with_units(held_values(law)),
        **bounds,
        "priors": {key_of(one.name): _prior(one) for one in law.parameters if one.prior},
        "emulator": settings.emulator,
        "most_solves": settings.most_solves,
        "genetic": asdict(minimiser)
        if is_dataclass(minimiser) and not isinstance(minimiser, type)
        else {"minimiser": getattr(minimiser, "__qualname__", repr(minimiser))},
        "forward_model": search.solver.model.fingerprint(),
    }


def _prior(parameter: Any) -> dict[str, Any]:
    prior = parameter.prior
    unit, factor = readable_unit(parameter.unit)
    return {
        "centre": factor * prior.centre,
        "unit": unit,
        "sd": prior.sd if prior.scale == "log" else factor * prior.sd,
        "normal_in": "logarithm" if prior.scale == "log" else "value",
        "source": prior.source,
    }


def versions() -> dict[str, str]:
    """Versions of legfem and of what a fit rests on."""
    return versions_of("legfem", "dolfinx", "numpy", "scipy", "pygad", "python")

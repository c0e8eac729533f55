"""A problem, its fit, and how that is assessed: goodness, cost, estimates, the search, and each test by itself.

`fit` searches for the unknowns of a `legfem.inverse.problem.Problem` and returns a `legfem.inverse.fit.Fit` for each
law.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, is_dataclass
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np

from legfem.common.units import FloatArray, readable_unit
from legfem.inverse import catalogue
from legfem.inverse.comparison import Comparison
from legfem.inverse.fit import Cost, Fit, Goodness, r_squared
from legfem.inverse.outcome import Forward, FullSolver
from legfem.inverse.parameter import Parameter
from legfem.inverse.search import Search
from legfem.inverse.searches import Found, Searched, Searches
from legfem.inverse.settings import IdentificationSettings, SearchRequest
from legfem.inverse.trial import FullSolve, SearchLog, Trial


class Problem[C: Comparison](Searched[C], Protocol):
    """Tests, a model of all of them, and what is unknown: all that a fit needs."""

    @property
    def forward(self) -> Forward:
        """Model of all tests: one curve a test in every outcome."""

    @property
    def sensitivities(self) -> tuple[str, ...]:
        """Full names of the model's parameters that solves are differentiated by."""

    @property
    def weighs_shared_errors(self) -> bool:
        """Whether errors are known only about a first search."""

    def assessed(self, found: Found[C]) -> Fit[Any]:
        """Result of a finished search."""


def fit[C: Comparison](
    problem: Problem[C], laws: Sequence[catalogue.LawName], request: SearchRequest
) -> list[Fit[Any]]:
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
    problem: Problem[C],
    laws: Sequence[catalogue.LawName],
    solver: FullSolver,
    settings: IdentificationSettings,
    near: Found[C] | None = None,
) -> list[Fit[Any]]:
    """Return a problem's fits by a solver that is kept for more, about a search that came near where there was one."""
    if near is None and problem.weighs_shared_errors:
        near = Searches(problem, solver, settings, refines=False).nearest(list(problem.unknowns))
    return [problem.assessed(found) for found in Searches(problem, solver, settings, near).find(laws)]


def goodness_of(found: Found[Any], covariance: FloatArray, lost: int = 0) -> Goodness:
    """Goodness of a law where it misses least in the readings' errors, priors included.

    Parameters
    ----------
    found
        The finished search.
    covariance
        (n, n): of measured less predicted readings.
    lost
        Degrees of freedom that were spent on other things than the law's parameters.
    """
    left, departures = found.linear.nearest(covariance)
    chi_square = float(left @ np.linalg.solve(covariance, left) + departures @ departures)
    return Goodness.of(chi_square, len(left) + len(departures) - len(found.search.law.parameters) - lost)


def cost_of(found: Found[Any]) -> Cost:
    """Plain sum of squares at the optimum."""
    search, best = found.search, found.best
    comparison, law = search.misfit, search.law
    value = float(comparison.cost(found.linear.prediction.values))
    measured = comparison.of_force(comparison.measured)
    weighting = comparison.weighting
    minimised = {
        "paper": "the sum itself (Eq. 12)",
        "covariance": "the sum weighted with the inverse covariance (dimensionless)",
        "equal": "the sum with equal weights within each channel (dimensionless), since the law misses the recordings",
    }[weighting]
    return Cost(
        value=value,
        points=len(measured),
        r_squared=r_squared(value, measured),
        minimised=minimised + (", and the priors' squared departures" if len(law.priors) else ""),
        minimised_value=best.objective,
        minimised_unit="N2" if weighting == "paper" else "1",
    )


def log_of(found: Found[Any]) -> SearchLog:
    """Course of a finished search."""
    search = found.search
    outcomes = found.outcomes
    return SearchLog(
        names=search.law.names,
        solves=tuple(_full_solve(trial, search) for trial in found.trials),
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
    told = outcome.complete, outcome.reason, outcome.factorisations, outcome.seconds
    return FullSolve(MappingProxyType(dict(trial.values)), cost, trial.stage, *told)


def held_values(law: catalogue.IdentifiedLaw) -> catalogue.Values:
    """Numbers that were held, in the model's units; none where a term is absent (C20 of 0, D2 infinite)."""
    return MappingProxyType(
        {
            name: value
            for name, value in {**law.nominal, **law.fixed}.items()
            if name not in law.names and math.isfinite(value) and (name, value) != (catalogue.DEEP_C20, 0.0)
        }
    )


def search_settings(search: Search[Any]) -> dict[str, Any]:
    """Numbers that a search depends on, their units in the names."""
    law, settings, minimiser = search.law, search.settings, search.settings.minimiser
    bounds = {}
    for parameter in law.parameters:
        unit, factor = readable_unit(parameter.unit)
        bounds[f"{catalogue.short_key_of(parameter.name)}_bounds_{catalogue.unit_suffix(unit)}"] = [
            factor * end for end in parameter.bounds
        ]
    return {
        **catalogue.with_units(held_values(law)),
        **bounds,
        "priors": {catalogue.key_of(one.name): prior_document(one) for one in law.parameters if one.prior},
        "most_solves": settings.most_solves,
        "genetic": asdict(minimiser)
        if is_dataclass(minimiser) and not isinstance(minimiser, type)
        else {"minimiser": getattr(minimiser, "__qualname__", repr(minimiser))},
        "forward_model": search.solver.model.fingerprint(),
    }


def prior_document(parameter: Parameter) -> dict[str, Any]:
    """What was known of a parameter beforehand, in the unit in which people read it."""
    prior = parameter.prior
    assert prior is not None
    unit, factor = readable_unit(parameter.unit)
    return {
        "centre": factor * prior.centre,
        "unit": unit,
        "sd": prior.sd if prior.scale == "log" else factor * prior.sd,
        "normal_in": "logarithm" if prior.scale == "log" else "value",
        "source": prior.source,
    }

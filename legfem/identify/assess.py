"""From a finished search to a result: fit, intervals, verdicts and warnings."""

from __future__ import annotations

import math
import platform
from collections.abc import Callable
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from scipy.stats import chi2

from legfem.identify.correction import Correction
from legfem.identify.domain import Domain
from legfem.identify.emulator import Emulator
from legfem.identify.forward import package_version
from legfem.identify.identifiability import judge
from legfem.identify.intervals import gain_matrix, profile_interval, quantile
from legfem.identify.misfit import Prediction
from legfem.identify.result import (
    Cost,
    CostMap,
    Estimate,
    FullSolve,
    IdentificationResult,
    PredictedCurve,
    SearchPath,
)
from legfem.identify.search import Search, Trial
from legfem.identify.warnings import Finding, warnings_about
from legfem.recording import LoadingCurve
from legfem.subject import Subject
from legfem.units import FloatArray

_MAP_SIZE = 81


@dataclass(frozen=True, eq=False)
class Assessment:
    """What a result is made from."""

    subject: Subject
    search: Search
    best: Trial
    """The optimum: the law's own, or its neo-Hookean limit's."""
    neo_hookean_limit: bool
    measured: LoadingCurve
    correction: Correction | None
    wall_s: float


def assess(given: Assessment) -> IdentificationResult:
    """Return the result of a finished search."""
    search, best = given.search, given.best
    assert best.prediction is not None
    settings, law = search.settings, search.law
    p = law.dimensions
    covariance = _covariance(given)
    gain = gain_matrix(search.misfit, best.prediction.jacobian(p))
    spread = gain @ covariance @ gain.T
    deviations = np.sqrt(np.diag(spread))
    correlation = float(spread[0, 1] / np.prod(deviations)) if p == 2 else math.nan
    cost = _cost(given, covariance)
    estimates = _estimates(given, best.prediction, spread, correlation)
    solves = [_full_solve(trial, search) for trial in search.trials]
    if best not in search.trials:
        solves.append(_full_solve(best, search))
    finding = Finding(
        given.subject, law.name, search.settings.bounds, estimates, cost, given.neo_hookean_limit,
        search.converged, tuple(solves), given.correction, given.measured,
    )  # fmt: skip
    return IdentificationResult(
        subject_id=given.subject.id,
        subject_title=given.subject.title,
        subject_origin=given.subject.origin,
        law=law.name,
        parameters=MappingProxyType(estimates),
        correlation=correlation,
        cost=cost,
        measured=given.measured,
        predicted=PredictedCurve(
            given.measured.displacement,
            best.prediction.force,
            MappingProxyType(best.prediction.sensitivities),
        ),
        search=SearchPath(tuple(solves), tuple(search.generations), _cost_map(search)),
        forward_solves=len(solves),
        reused_solves=sum(trial.outcome.deep in search.solver.reused for trial in search.trials),
        factorisations=sum(solve.factorisations for solve in solves),
        wall_s=given.wall_s,
        seed=settings.seed,
        emulator_error=search.emulator_error,
        correction=None if given.correction is None else given.correction.name,
        weighting=settings.weighting,
        converged=search.converged,
        neo_hookean_limit=given.neo_hookean_limit,
        warnings=warnings_about(finding),
        settings=_settings(given),
        versions=_versions(),
    )


def _covariance(given: Assessment) -> FloatArray:
    return given.search.misfit.covariance_at(*given.best.stiffness)


def _cost(given: Assessment, covariance: FloatArray) -> Cost:
    misfit, best, measured = given.search.misfit, given.best, given.measured
    assert best.prediction is not None
    residual = best.prediction.force - measured.force
    value, n = float(misfit.cost(best.prediction.force)), len(residual)
    chi_square = float(residual @ np.linalg.solve(covariance, residual))
    degrees = n - given.search.law.dimensions
    weighting = {
        "paper": "the sum itself (Eq. 12)",
        "covariance": "the sum weighted with the inverse covariance (dimensionless)",
    }
    return Cost(
        value=value,
        points=n,
        mean_square=value / n,
        per_length=value / given.subject.indenter.length**2,
        rms=math.sqrt(value / n),
        r_squared=1 - value / float(np.sum((measured.force - measured.force.mean()) ** 2)),
        chi_square=chi_square,
        degrees_of_freedom=degrees,
        p_value=float(chi2.sf(chi_square, degrees)),
        minimised=weighting[given.search.settings.weighting],
        minimised_value=best.objective,
    )


def _estimates(
    given: Assessment, prediction: Prediction, spread: FloatArray, correlation: float
) -> dict[str, Estimate]:
    search, settings = given.search, given.search.settings
    p, at = search.law.dimensions, given.best.stiffness[: search.law.dimensions]
    bounds = np.array([settings.bounds.c10, settings.bounds.c20])[:p]
    if given.neo_hookean_limit:
        bounds[1, 0] = 0.0
    objective = _objective(search, given.best, prediction)
    jacobian = prediction.jacobian(p)
    weighted = search.misfit.weighted(jacobian)
    curvature = np.linalg.pinv(weighted.T @ weighted)
    times = quantile(given.measured.noise.repeat_dof)
    free = [k for k in range(p) if _bound(float(at[k]), bounds[k]) == ""]
    held = gain_matrix(search.misfit, jacobian[:, free]) if free else np.zeros((0, len(jacobian)))
    found = {}
    for k, name in enumerate(("C10", "C20")[:p]):
        error = math.sqrt(spread[k, k])
        rise = times**2 * spread[k, k] / curvature[k, k]
        ci95 = profile_interval(objective, at, k, float(rise), bounds, times * error)
        at_bound = _bound(float(at[k]), bounds[k])
        moves = []
        for tissue in ("superficial", "fascia"):
            stiffness = given.subject.tissues[tissue].C10
            force = prediction.sensitivities[f"{tissue}.C10"]
            if k not in free or stiffness is None or at[k] <= 0:
                moves.append(math.nan)
                continue
            change = -held[free.index(k)] @ force * 0.1 * (1e3 * stiffness)
            moves.append(float(change / at[k]))
        verdict, why = judge(
            name, float(at[k]), ci95, correlation, moves[0], moves[1], at_bound, settings
        )
        found[f"{name.lower()}_deep"] = Estimate(
            float(at[k]), error, ci95, verdict, why, moves[0], moves[1], at_bound
        )
    return found


def _bound(value: float, bounds: FloatArray) -> Literal["", "lower", "upper"]:
    if value <= bounds[0]:
        return "lower"
    return "upper" if value >= bounds[1] else ""


def _objective(
    search: Search, best: Trial, prediction: Prediction
) -> Callable[[FloatArray], FloatArray]:
    """Return what is minimised, of stiffnesses (n, p), without further full solves."""
    p, misfit = search.law.dimensions, search.misfit
    if search.settings.emulator:
        emulator = search.emulator()

        def on_emulator(stiffness: FloatArray) -> FloatArray:
            c20 = stiffness[:, 1] if p == 2 else np.zeros(len(stiffness))
            return misfit.objective(emulator(stiffness[:, 0], c20))

        return on_emulator
    jacobian = prediction.jacobian(p)

    def on_tangent(stiffness: FloatArray) -> FloatArray:
        apart = stiffness - best.stiffness[:p]
        return misfit.objective(prediction.force + apart @ jacobian.T)

    return on_tangent


def _full_solve(trial: Trial, search: Search) -> FullSolve:
    outcome = trial.outcome
    cost = math.nan
    if trial.prediction is not None:
        cost = float(search.misfit.cost(trial.prediction.force))
    return FullSolve(
        outcome.deep.C10, outcome.deep.C20, cost, trial.stage, outcome.complete, outcome.reason,
        outcome.factorisations, outcome.seconds,
    )  # fmt: skip


def _cost_map(search: Search) -> CostMap | None:
    """Return the cost over the region that was solved in."""
    if not search.settings.emulator:
        return None
    emulator: Emulator = search.emulator()
    solved = np.array([trial.stiffness for trial in search.complete])
    c10 = np.geomspace(0.7 * solved[:, 0].min(), 1.4 * solved[:, 0].max(), _MAP_SIZE)
    c20: FloatArray = np.zeros(1)
    if search.law.dimensions == 2:
        domain: Domain = search.domain
        low, high = domain.genes(np.array([solved.min(axis=0), solved.max(axis=0)]))[:, 1]
        genes = np.column_stack(
            [np.zeros(_MAP_SIZE), np.linspace(float(low), float(high), _MAP_SIZE)]
        )
        c20 = domain.stiffness(genes)[:, 1]
    across, up = np.meshgrid(c10, c20)
    return CostMap(c10, c20, search.misfit.cost(emulator(across, up)))


def _settings(given: Assessment) -> dict[str, Any]:
    settings, law = given.search.settings, given.search.law
    fixed = {
        f"{name}_{key}": value
        for name, tissue in given.subject.tissues.items()
        for key, value in (
            ("C10_kPa", None if name == "deep" or tissue.C10 is None else 1e3 * tissue.C10),
            ("D1_per_MPa", tissue.D1),
        )
        if value is not None
    }
    return {
        "depth_mm": float(given.measured.displacement[-1]),
        "deep_D2_per_MPa": law.D2,
        "fascia_thickness_mm": given.subject.section.fascia_thickness,
        **fixed,
        "c10_bounds_kPa": list(settings.bounds.c10),
        "c20_bounds_kPa": list(settings.bounds.c20),
        "emulator": settings.emulator,
        "most_solves": settings.most_solves,
        "genetic": asdict(settings.genetic if settings.emulator else settings.plain_genetic),
        "numerical_error_relative": settings.numerical_error,
        "numerical_error_length_mm": settings.numerical_error_length,
        "interval": "95 %, profile of the cost, t quantile "
        f"{quantile(given.measured.noise.repeat_dof):.2f}, covariance of recordings and "
        "numerical error",
        "identifiable_within_relative_half_width": settings.identifiable_within,
        "weakly_identifiable_within_relative_half_width": settings.weakly_within,
        "forward_model": given.search.solver.model.fingerprint(),
    }


def _versions() -> dict[str, str]:
    names = {
        "legfem": "legfem",
        "dolfinx": "fenics-dolfinx",
        "numpy": "numpy",
        "scipy": "scipy",
        "pygad": "pygad",
    }
    return {
        **{name: package_version(package) for name, package in names.items()},
        "python": platform.python_version(),
    }

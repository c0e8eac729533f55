"""From a finished search to a result: fit, intervals, verdicts and warnings."""

from __future__ import annotations

import math
import platform
from collections.abc import Callable
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.stats import chi2

from legfem.identify.correction import Correction
from legfem.identify.domain import Domain
from legfem.identify.emulator import Emulator
from legfem.identify.forward import legfem_version, package_version
from legfem.identify.identifiability import Evidence, judge
from legfem.identify.intervals import gain_matrix, profile_interval, quantile
from legfem.identify.misfit import Prediction
from legfem.identify.result import (
    AppliedCorrection,
    Bound,
    Cost,
    CostMap,
    Estimate,
    FullSolve,
    IdentificationResult,
    PredictedCurve,
    SearchPath,
)
from legfem.identify.search import Search, Trial
from legfem.identify.warnings import LEAST_CHANCE, Finding, warnings_about
from legfem.recording import LoadingCurve
from legfem.subject import Subject
from legfem.units import FloatArray, mpa_to_kpa

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
    cost = _cost(given, covariance)
    estimates = _estimates(given, spread, cost.p_value >= LEAST_CHANCE)
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
        correlation=_correlation(spread),
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
        correction=_applied(given),
        weighting=settings.weighting,
        converged=search.converged,
        neo_hookean_limit=given.neo_hookean_limit,
        warnings=warnings_about(finding),
        settings=_settings(given),
        versions=_versions(),
    )


def _applied(given: Assessment) -> AppliedCorrection | None:
    correction, displacement = given.correction, given.measured.displacement
    if correction is None:
        return None
    c10, c20 = given.best.stiffness
    factor = correction.factor(displacement, np.asarray(c10), np.asarray(c20))
    sd = factor * np.sqrt(np.diag(correction.covariance(displacement, c10, c20)))
    return AppliedCorrection(correction.name, 1 - factor, sd)


def _covariance(given: Assessment) -> FloatArray:
    return given.search.misfit.covariance_at(*given.best.stiffness)


def _cost(given: Assessment, covariance: FloatArray) -> Cost:
    misfit, best, measured = given.search.misfit, given.best, given.measured
    settings = given.search.settings
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
        minimised=weighting[settings.weighting],
        minimised_value=best.objective,
        minimised_unit="N2" if settings.weighting == "paper" else "1",
    )


def _estimates(given: Assessment, spread: FloatArray, law_fits: bool) -> dict[str, Estimate]:
    search, prediction = given.search, given.best.prediction
    assert prediction is not None
    p = search.law.dimensions
    at, bounds = given.best.stiffness[:p], _bounds(given)
    objective = _objective(search, given.best, prediction)
    weighted = search.misfit.weighted(prediction.jacobian(p))
    curvature = np.linalg.pinv(weighted.T @ weighted)
    times = quantile(given.measured.noise.repeat_dof)
    per_fat, per_fascia = (_moves(given, tissue) for tissue in ("superficial", "fascia"))
    found = {}
    for k, name in enumerate(("C10", "C20")[:p]):
        error = math.sqrt(spread[k, k])
        rise = float(times**2 * spread[k, k] / curvature[k, k])
        evidence = Evidence(
            name,
            float(at[k]),
            profile_interval(objective, at, k, rise, bounds, times * error),
            _bound(float(at[k]), bounds[k]),
            _correlation(spread),
            float(per_fat[k]),
            float(per_fascia[k]),
            law_fits,
        )
        verdict, why = judge(evidence, search.settings)
        found[f"{name.lower()}_deep"] = Estimate(
            evidence.value, error, evidence.ci95, verdict, why, evidence.per_fat,
            evidence.per_fascia, evidence.at_bound,
        )  # fmt: skip
    return found


def _moves(given: Assessment, tissue: str) -> FloatArray:
    """Return the parameters' relative changes (p,) if a tissue were 10 % stiffer; NaN at bounds."""
    p, prediction = given.search.law.dimensions, given.best.prediction
    assert prediction is not None
    at, bounds = given.best.stiffness[:p], _bounds(given)
    moves = np.full(p, math.nan)
    free = [k for k in range(p) if _bound(float(at[k]), bounds[k]) == ""]
    stiffness = given.subject.tissues[tissue].C10
    if stiffness is not None and free:
        gain = gain_matrix(given.search.misfit, prediction.jacobian(p)[:, free])
        force = prediction.sensitivities[f"{tissue}.C10"] * 0.1 * mpa_to_kpa(stiffness)
        moves[free] = -(gain @ force) / at[free]
    return moves


def _bounds(given: Assessment) -> FloatArray:
    bounds, p = given.search.settings.bounds, given.search.law.dimensions
    c20 = (0.0 if given.neo_hookean_limit else bounds.c20[0], bounds.c20[1])
    return np.array([bounds.c10, c20])[:p]


def _bound(value: float, bounds: FloatArray) -> Bound:
    if value <= bounds[0]:
        return "lower"
    return "upper" if value >= bounds[1] else ""


def _correlation(spread: FloatArray) -> float:
    if len(spread) < 2:
        return math.nan
    return float(spread[0, 1] / math.sqrt(spread[0, 0] * spread[1, 1]))


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
            ("C10_kPa", None if name == "deep" or tissue.C10 is None else mpa_to_kpa(tissue.C10)),
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
        "legfem": legfem_version(),
        **{name: package_version(package) for name, package in names.items()},
        "python": platform.python_version(),
    }

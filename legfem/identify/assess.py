"""From a finished search to a result: fit, intervals, verdicts and warnings."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, is_dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.special import chdtrc

from legfem.common.units import FloatArray, mpa_to_kpa, readable_unit
from legfem.common.versions import versions_of
from legfem.correction.choice import Correction
from legfem.data import LoadingCurve
from legfem.identify.applied_correction import AppliedCorrection
from legfem.identify.error_sources import source_of_mode
from legfem.identify.misfit import Misfit
from legfem.identify.result import Cost, IdentificationResult, PredictedCurve
from legfem.identify.warnings import LEAST_CHANCE, Finding, doubts_of, warnings_about
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, DEEP_D2, Values, key_of, short_key_of, unit_suffix, with_units
from legfem.inverse.comparison import total_of
from legfem.inverse.estimates import Optimum, correlations_of, estimates
from legfem.inverse.intervals import IDENTIFIABLE_WITHIN, NUMERICAL_ERROR, NUMERICAL_LENGTH_MM, WEAKLY_WITHIN, quantile
from legfem.inverse.laws import IdentifiedLaw
from legfem.inverse.search import Search
from legfem.inverse.search_log import CostMap, FullSolve, SearchLog
from legfem.inverse.searches import Found
from legfem.inverse.trial import Trial
from legfem.legs.subject import Subject

_MAP_SIZE = 81
_ASSUMED = ("superficial.C10", "fascia.C10")


@dataclass(frozen=True, eq=False)
class Assessment:
    """What a result is made from."""

    subject: Subject
    found: Found[Misfit]
    measured: LoadingCurve
    correction: Correction | None

    @property
    def search(self) -> Search[Misfit]:
        """That found it."""
        return self.found.search

    @property
    def best(self) -> Trial:
        """The optimum."""
        return self.found.best


def assess(given: Assessment) -> IdentificationResult:
    """Return the result of a finished search."""
    search, best, linear = given.search, given.best, given.found.linear
    limit = given.found.neo_hookean_limit
    settings, law = search.settings, search.law
    covariances = search.misfit.covariances_at(best.values)
    cost = _cost(given, total_of(covariances))
    optimum = Optimum(
        linear,
        given.found.residual,
        covariances,
        quantile(given.measured.noise.repeat_dof),
        cost.p_value >= LEAST_CHANCE,
        assumed_stiffness(law),
    )
    found = estimates(optimum)
    solves = tuple(_full_solve(trial, search) for trial in given.found.trials)
    outcomes = given.found.outcomes
    applied = applied_correction(given.correction, given.measured.displacement, best.values)
    finding = Finding(
        given.subject,
        law.name,
        found,
        cost,
        limit,
        search.converged,
        solves,
        applied,
        given.measured,
        best.outcome.compromise,
    )
    return IdentificationResult(
        subject_id=given.subject.id,
        subject_title=given.subject.title,
        subject_origin=given.subject.origin,
        law=law.name,
        parameters=MappingProxyType(found),
        correlations=correlations_of(optimum.spread),
        values=MappingProxyType(dict(best.values)),
        assumed=MappingProxyType(held_values(law)),
        cost=cost,
        measured=given.measured,
        predicted=PredictedCurve(
            given.measured.displacement,
            linear.prediction.force,
            MappingProxyType(dict(linear.prediction.sensitivities)),
        ),
        search=SearchLog(law.names, solves, tuple(search.generations), _cost_map(search)),
        forward_solves=len(outcomes),
        reused_solves=given.found.reused_solves,
        factorisations=sum(one.factorisations for one in outcomes),
        wall_s=given.found.wall_s,
        seed=settings.seed,
        emulator_error=search.emulator_error,
        correction=applied,
        weighting=search.misfit.weighting,
        converged=search.converged,
        neo_hookean_limit=limit,
        warnings=warnings_about(finding),
        settings=_settings(given),
        versions=versions(),
        doubts=doubts_of(finding),
        fibres=given.subject.fibres,
    )


def assumed_stiffness(law: IdentifiedLaw) -> dict[str, float]:
    """Return the stiffnesses of fat and fascia that were held, MPa."""
    every = {**law.nominal, **law.fixed}
    return {name: every[name] for name in _ASSUMED if name in every and name not in law.names}


def applied_correction(
    correction: Correction | None, displacement: FloatArray, values: Values
) -> AppliedCorrection | None:
    """Return what a correction is at displacements (n,), mm, and the model's values."""
    if correction is None:
        return None
    c10, c20 = mpa_to_kpa(values[DEEP_C10]), mpa_to_kpa(values.get(DEEP_C20, 0.0))
    factor = correction.factor(displacement, np.asarray(c10), np.asarray(c20))
    modes = correction.relative_errors(displacement, c10, c20)
    sd = factor * np.sqrt(sum(mode**2 for mode in modes.values()))
    fibrous = any(source_of_mode(name) == "fibres" for name in modes)
    return AppliedCorrection(correction.name, 1 - factor, sd, fibrous)


def _cost(given: Assessment, covariance: FloatArray) -> Cost:
    search, best, measured = given.search, given.best, given.measured
    misfit, law = search.misfit, search.law
    assert best.prediction is not None
    residual = best.prediction.force - measured.force
    value, n = float(misfit.cost(best.prediction.force)), len(residual)
    departures = law.priors.residual(best.point)
    chi_square = float(residual @ np.linalg.solve(covariance, residual) + departures @ departures)
    degrees = n + len(departures) - len(law.parameters)
    weighting = {
        "paper": "the sum itself (Eq. 12)",
        "covariance": "the sum weighted with the inverse covariance (dimensionless)",
    }
    priors = ", and the priors' squared departures" if len(departures) else ""
    return Cost(
        value=value,
        points=n,
        mean_square=value / n,
        per_length=value / given.subject.indenter.length**2,
        rms=math.sqrt(value / n),
        r_squared=1 - value / float(np.sum((measured.force - measured.force.mean()) ** 2)),
        chi_square=chi_square,
        degrees_of_freedom=degrees,
        p_value=float(chdtrc(degrees, chi_square)),
        minimised=weighting[misfit.weighting] + priors,
        minimised_value=best.objective,
        minimised_unit="N2" if misfit.weighting == "paper" else "1",
    )


def _full_solve(trial: Trial, search: Search) -> FullSolve:
    outcome = trial.outcome
    cost = math.nan
    if trial.prediction is not None:
        cost = float(search.misfit.cost(trial.prediction.force))
    return FullSolve(
        MappingProxyType(dict(trial.values)),
        cost,
        trial.stage,
        outcome.complete,
        outcome.reason,
        outcome.factorisations,
        outcome.seconds,
    )


def _cost_map(search: Search) -> CostMap | None:
    """Return the cost over the region that was solved in, of one or two parameters."""
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
    cost = search.emulated().cost(points)
    return CostMap(law.names, across, up, cost)


def _settings(given: Assessment) -> dict[str, Any]:
    search, law = given.search, given.search.law
    settings = search.settings
    minimiser = settings.minimiser if settings.emulator else settings.plain_minimiser
    bounds = {}
    for parameter in law.parameters:
        unit, factor = readable_unit(parameter.unit)
        key = f"{short_key_of(parameter.name)}_bounds_{unit_suffix(unit)}"
        bounds[key] = [factor * end for end in parameter.bounds]
    return {
        "depth_mm": float(given.measured.displacement[-1]),
        "deep_D2_per_MPa": {**law.nominal, **law.fixed}.get(DEEP_D2, math.inf),
        "fascia_thickness_mm": given.subject.section.fascia_thickness,
        **with_units(held_values(law)),
        **bounds,
        "priors": {key_of(one.name): _prior(one) for one in law.parameters if one.prior},
        "emulator": settings.emulator,
        "most_solves": settings.most_solves,
        "genetic": asdict(minimiser)
        if is_dataclass(minimiser) and not isinstance(minimiser, type)
        else {"minimiser": getattr(minimiser, "__qualname__", repr(minimiser))},
        "numerical_error_relative": NUMERICAL_ERROR,
        "numerical_error_length_mm": NUMERICAL_LENGTH_MM,
        "interval": "95 %, profile of the cost, t quantile "
        f"{quantile(given.measured.noise.repeat_dof):.2f}, covariance of recordings and "
        "numerical error",
        "identifiable_within_relative_half_width": IDENTIFIABLE_WITHIN,
        "weakly_identifiable_within_relative_half_width": WEAKLY_WITHIN,
        "forward_model": search.solver.model.fingerprint(),
    }


def held_values(law: IdentifiedLaw) -> dict[str, float]:
    """Return the numbers that were held; none where a term is absent (C20 of 0, D2 infinite)."""
    return {
        name: value
        for name, value in {**law.nominal, **law.fixed}.items()
        if name not in law.names and math.isfinite(value) and (name, value) != (DEEP_C20, 0.0)
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
    """Return those of legfem and of what a result rests on."""
    return versions_of("legfem", "dolfinx", "numpy", "scipy", "pygad", "python")

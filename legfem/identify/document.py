"""The JSON document of a result."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from legfem.identify.result import Cost, Estimate, IdentificationResult, SearchPath

SCHEMA = "legfem.identify/1"


def result_document(result: IdentificationResult) -> dict[str, Any]:
    """Return a result as JSON types; every number's unit is in its name or beside it."""
    verdict, why = result.identifiability
    document = {
        "schema": SCHEMA,
        "subject": result.subject_id,
        "title": result.subject_title,
        "origin": result.subject_origin,
        "law": result.law,
        "parameters": {name: _estimate(found) for name, found in result.parameters.items()},
        "correlation_c10_c20": result.correlation,
        "identifiability": verdict,
        "identifiability_why": why,
        "cost": _cost(result.cost),
        "converged": result.converged,
        "neo_hookean_limit": result.neo_hookean_limit,
        "warnings": list(result.warnings),
        "forward_solves": result.forward_solves,
        "forward_solves_reused": result.reused_solves,
        "failed_solves": sum(not solve.complete for solve in result.search.solves),
        "factorisations": result.factorisations,
        "wall_s": result.wall_s,
        "seed": result.seed,
        "emulator_error_N": result.emulator_error,
        "correction": None if result.correction is None else result.correction.name,
        "weighting": result.weighting,
        "curve": {
            "displacement_mm": result.predicted.displacement,
            "force_N": result.predicted.force,
            "measured_force_N": result.measured.force,
            "measured_force_standard_error_N": result.measured.force_sd,
            "force_derivative_N_per_kPa": dict(result.predicted.sensitivities),
            "correction_P": None if result.correction is None else result.correction.P,
            "correction_P_sd": None if result.correction is None else result.correction.sd,
        },
        "noise": {
            "reading_force_sd_N": result.measured.noise.force_sd,
            "correlation_length_mm": result.measured.noise.correlation_length,
            "trials": result.measured.n_trials,
            "source": result.measured.noise.source,
        },
        "search": _search(result.search),
        "settings": dict(result.settings),
        "versions": dict(result.versions),
    }
    return {key: _plain(value) for key, value in document.items()}


def _estimate(found: Estimate) -> dict[str, Any]:
    return {
        "value": found.value,
        "unit": found.unit,
        "standard_error": found.standard_error,
        "ci95": list(found.ci95),
        "at_bound": found.at_bound,
        "identifiability": found.identifiability,
        "why": found.why,
        "relative_change_if_fat_c10_is_10_percent_higher": found.per_fat,
        "relative_change_if_fascia_c10_is_10_percent_higher": found.per_fascia,
    }


def _cost(cost: Cost) -> dict[str, Any]:
    return {
        "value": cost.value,
        "unit": "N2",
        "definition": cost.definition,
        "points": cost.points,
        "mean_square_N2": cost.mean_square,
        "per_length_N2_per_mm2": cost.per_length,
        "rms_N": cost.rms,
        "r_squared": cost.r_squared,
        "chi_square": cost.chi_square,
        "degrees_of_freedom": cost.degrees_of_freedom,
        "p_value": cost.p_value,
        "minimised": cost.minimised,
        "minimised_value": cost.minimised_value,
        "minimised_unit": cost.minimised_unit,
    }


def _search(search: SearchPath) -> dict[str, Any]:
    return {
        "solves": [
            {
                "c10_kPa": solve.c10,
                "c20_kPa": solve.c20,
                "cost_N2": solve.cost,
                "stage": solve.stage,
                "complete": solve.complete,
                "reason": solve.reason,
                "factorisations": solve.factorisations,
                "seconds": solve.seconds,
            }
            for solve in search.solves
        ],
        "generations": [
            {
                "round": best.round,
                "generation": best.number,
                "c10_kPa": best.c10,
                "c20_kPa": best.c20,
                "cost_N2": best.cost,
            }
            for best in search.generations
        ],
        "cost_map": None
        if search.cost_map is None
        else {
            f"{key}_{unit}": value
            for (key, value), unit in zip(
                asdict(search.cost_map).items(), ("kPa", "kPa", "N2"), strict=True
            )
        },
    }


def _plain(value: Any) -> Any:
    """Return JSON types; what isn't finite becomes null, which every reader understands."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value

"""The JSON document of a result."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from legfem.common.documents import json_types
from legfem.common.doubts import doubt_documents
from legfem.common.units import readable_unit
from legfem.identify.result import Cost, IdentificationResult, IdentifiedParameters, PredictedCurve
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, Values, key_of, short_key_of, unit_of, unit_suffix
from legfem.inverse.estimates import DISPLACEMENT, FORCE, Estimate
from legfem.inverse.search_log import CostMap, SearchLog
from legfem.legs.details import AppliedCorrection, SpatialEvidence
from legfem.legs.elastography import FibreRatio

SCHEMA = "legfem.identify/1"


def result_document(result: IdentificationResult) -> dict[str, Any]:
    """Return a result as JSON types; every number's unit is in its name or beside it."""
    verdict, why = result.identifiability
    document = {
        "schema": SCHEMA,
        "subject": result.subject_id,
        "title": result.subject_title,
        "origin": result.subject_origin,
        **searched_document(result),
        "doubts": doubt_documents(result.doubts),
        "correlation_c10_c20": result.correlation(DEEP_C10, DEEP_C20),
        "identifiability": verdict,
        "identifiability_why": why,
        "cost": _cost(result.cost),
        "neo_hookean_limit": result.neo_hookean_limit,
        "failed_solves": result.failed_solves,
        "factorisations": result.factorisations,
        "model": "2d" if result.spatial is None else "3d",
        "spatial": None if result.spatial is None else _spatial(result.spatial),
        "correction": None if result.correction is None else result.correction.name,
        "fibres": None if result.fibres is None else _fibres(result.fibres, result.correction),
        "weighting": result.weighting,
        "curve": {
            "displacement_mm": result.predicted.displacement,
            "force_N": result.predicted.force,
            "measured_force_N": result.measured.force,
            "measured_force_standard_error_N": result.measured.force_sd,
            **_derivatives(result.predicted),
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
    }
    plain: dict[str, Any] = json_types(document)
    return plain


def searched_document(result: IdentifiedParameters) -> dict[str, Any]:
    """Return what every identification of one law has found, and how it was searched for."""
    keys = [key_of(name) for name in result.parameters]
    return {
        "law": result.law,
        "parameters": dict(zip(keys, map(_estimate, result.parameters.values()), strict=True)),
        "correlations": {
            key: dict(zip(keys, map(float, row), strict=True))
            for key, row in zip(keys, result.correlations, strict=True)
        },
        "converged": result.converged,
        "warnings": list(result.warnings),
        "forward_solves": result.forward_solves,
        "forward_solves_reused": result.reused_solves,
        "emulator_error_N": result.emulator_error,
        "seed": result.seed,
        "wall_s": result.wall_s,
        "versions": dict(result.versions),
    }


def _estimate(found: Estimate) -> dict[str, Any]:
    """Return a parameter's estimate, in the unit in which people read it."""
    shown = found.shown
    return {
        "value": shown.value,
        "unit": shown.unit,
        "standard_error": shown.standard_error,
        "ci95": list(shown.ci95),
        "role": found.parameter.role,
        "at_bound": found.at_bound,
        "identifiability": found.identifiability,
        "why": found.why,
        "share_of_squared_error": dict(found.error_shares),
        "relative_change_if_fat_c10_is_10_percent_higher": found.moves.get("superficial.C10"),
        "relative_change_if_fascia_c10_is_10_percent_higher": found.moves.get("fascia.C10"),
        "relative_change_if_forces_are_10_percent_higher": found.moves.get(FORCE),
        "relative_change_if_displacements_are_10_percent_higher": found.moves.get(DISPLACEMENT),
    }


def _derivatives(predicted: PredictedCurve) -> dict[str, Any]:
    """Return the force's derivatives: by stresses a kPa, by the others a unit of theirs."""
    by_stress, others = {}, {}
    for name, values in predicted.sensitivities.items():
        unit, factor = readable_unit(unit_of(name))
        if unit == "kPa":
            by_stress[name] = values / factor
        else:
            others[name] = {"unit": unit, "N_per_unit": values}
    more = {"force_derivative_by_others": others} if others else {}
    return {"force_derivative_N_per_kPa": by_stress, **more}


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


def _fibres(fibres: FibreRatio, correction: AppliedCorrection | None) -> dict[str, Any]:
    return {
        "ratio": fibres.value,
        "sd": fibres.sd,
        "provenance": fibres.provenance,
        "source": fibres.source,
        "in_correction": correction is not None and correction.with_fibres,
    }


def _spatial(found: SpatialEvidence) -> dict[str, Any]:
    return {
        "shape": found.shape,
        "extruded": found.extruded,
        "length_mm": found.length,
        "converged": found.converged,
        "full_solves": found.full_solves,
        "rough_solves": found.rough_solves,
        "confirmations": [
            {
                "c10_kPa": one.c10,
                "c20_kPa": one.c20,
                "seconds": one.seconds,
                "factorisations": one.factorisations,
                "relative_difference_from_predicted_force": one.error,
                "relative_change_of_c10_after": one.moved,
            }
            for one in found.confirmations
        ],
        "greatest_error_of_P": dict(found.errors),
        "correction_P_of_table": found.table_P,
    }


def _search(search: SearchLog) -> dict[str, Any]:
    free = search.names
    return {
        "solves": [
            {
                **_values(solve.values, free),
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
            {"round": best.round, "generation": best.number, **_values(best.values, free), "cost_N2": best.cost}
            for best in search.generations
        ],
        "cost_map": None if search.cost_map is None else _cost_map(search.cost_map),
    }


def _values(values: Values, free: Sequence[str]) -> dict[str, float]:
    """Return C10 and C20 of the deep tissue and what else is free, keys with units."""
    shown = {}
    for name in dict.fromkeys((DEEP_C10, DEEP_C20, *free)):
        unit, factor = readable_unit(unit_of(name))
        if name in values:
            shown[_key_with_unit(name, unit)] = factor * values[name]
    return shown


def _cost_map(known: CostMap) -> dict[str, Any]:
    names = known.names if len(known.names) == 2 else (*known.names, DEEP_C20)
    axes = {}
    for name, values in zip(names, (known.across, known.up), strict=True):
        unit, factor = readable_unit(unit_of(name))
        axes[_key_with_unit(name, unit)] = factor * values
    return {**axes, "cost_N2": known.cost}


def _key_with_unit(name: str, unit: str) -> str:
    """Return ``c10_kPa`` for ``deep.C10``, ``c10_superficial_kPa`` for another tissue's."""
    return f"{short_key_of(name)}_{unit_suffix(unit)}"

"""``result.json`` of a leg in its stocking: every number with its unit."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from legfem.common.documents import json_types, versions_of
from legfem.common.errors import doubt_documents
from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.geometry.leg_shape import fat_thickness_around
from legfem.inverse.parameter import Prior
from legfem.legs.elastography import elastography_priors
from legfem.stockings.estimates import StiffnessEstimate, StiffnessFit, expected_rms, starts_agree
from legfem.stockings.fabric import stocking_load
from legfem.stockings.leg import ComparedSensor
from legfem.stockings.levels import LevelPressure, PressureAlong, pressures_at_levels
from legfem.stockings.notices import stocking_notices, unloaded_skin
from legfem.stockings.pressures import FatPressures, too_low_by
from legfem.stockings.result import StockingResult
from legfem.stockings.scan_fit import by_name

SCHEMA = "legfem.stocking/1"


def stocking_document(result: StockingResult, fat: FatPressures | None = None) -> dict[str, Any]:
    """Return a result as JSON types; what isn't finite is null.

    Parameters
    ----------
    result
        Of a run.
    fat
        Pressures in the fat, if the worn state was found.
    """
    leg, solves = result.leg, sum(search.solves for search in result.searches)
    return json_types(
        {
            "schema": SCHEMA,
            "leg": leg.id,
            "title": leg.title,
            "origin": leg.origin,
            "doubts": doubt_documents(leg.doubts),
            "stiffness": _stiffness(result),
            "searches": [_search(search) for search in result.searches],
            "starts_agree": starts_agree(result.weighted) if result.weighted else None,
            "contours": _contours(result),
            "mismatch": _discrepancy(result),
            "registration": _registration(result),
            "stocking": _stocking(result),
            "pressures": _pressures(result),
            "makers_levels": [_level(one) for one in levels_of(result)],
            "sensors": [_sensor(one) for one in result.sensors],
            "fat": _fat(result, fat),
            "worn_state": {
                "found": result.equilibrium.state.report.complete,
                "reason": result.equilibrium.state.report.reason,
                "converged": result.equilibrium.converged,
                "relative_pressure_changes": list(result.equilibrium.changes),
            },
            "warnings": list(stocking_notices(result)),
            "model": _model(result),
            "solves": {"identification": solves, "all": result.states},
            "wall_s": result.wall_s,
            "versions": versions(),
        }
    )


def versions() -> dict[str, str]:
    """Return those of the programs that make a result."""
    return versions_of("legfem", "dolfinx", "numpy", "scipy", "python")


def _stiffness(result: StockingResult) -> dict[str, Any]:
    identified = {known.name: known for known in result.estimates}
    priors = elastography_priors(result.leg.elastography)
    return {
        _key(name): {
            "used_for_pressures": {"value": mpa_to_kpa(value), "unit": "kPa"},
            "prior": _prior(priors.get(name)),
            "given": result.leg.known,
            "identified": _known(identified[name]) if name in identified else None,
        }
        for name, value in result.parameters.items()
    }


def _prior(prior: Prior | None) -> dict[str, Any] | None:
    if prior is None:
        return None
    return {"value": mpa_to_kpa(prior.centre), "sd": mpa_to_kpa(prior.sd), "unit": "kPa", "source": prior.source}


def _known(known: StiffnessEstimate) -> dict[str, Any]:
    return {
        "value": mpa_to_kpa(known.value),
        "unit": "kPa",
        "ci95": [mpa_to_kpa(value) for value in known.ci95],
        "relative_half_width": known.relative_half_width,
        "at_bound": known.at_bound,
        "identifiability": known.identifiability,
    }


def _search(search: StiffnessFit) -> dict[str, Any]:
    def both(values: FloatArray) -> dict[str, float]:
        return {f"{_key(name)}_kPa": mpa_to_kpa(value) for name, value in by_name(values).items()}

    return {
        "method": search.method,
        "start": both(search.start),
        "found": both(search.parameters),
        "state_found": search.equilibrium.state.report.complete,
        "converged": search.converged,
        "solves": search.solves,
        "rms_distance_mm": search.rms,
        "cost": search.cost,
        "cost_unit": "1 at the start" if search.method == "nelder-mead" else "mm2",
        "weighted_misfit": search.chi_square,
        "rigid_motion": None
        if search.rigid is None
        else {"shift_mm": search.rigid[:3].tolist(), "turn_rad": search.rigid[3:].tolist()},
        "tension_error": None
        if search.tension is None
        else {"value": search.tension.value, "standard_error": search.tension.sd, "unit": "1"},
        "log_covariance": None if search.log_covariance is None else search.log_covariance.tolist(),
    }


def _contours(result: StockingResult) -> dict[str, Any] | None:
    misfit, accuracy = result.misfit, result.leg.accuracy
    if misfit is None:
        return None
    bare = misfit.distances(result.leg.bare)
    return {
        "levels_mm": misfit.target.levels.tolist(),
        "expected_rms_distance_mm": expected_rms(accuracy),
        "bare_rms_distance_mm": float(np.sqrt(np.mean(bare**2))),
        "segmentation_sd_mm": accuracy.sd,
        "segmentation_correlation_mm": accuracy.correlation,
        "contour_sd_mm": accuracy.smoothed_sd,
        "pressure_relative_sd": accuracy.pressure_sd,
        "tension_relative_sd": accuracy.tension_sd,
        "model_sd_mm": accuracy.model_sd,
        "shift_sd_mm": list(accuracy.shift_sd),
        "turn_sd_rad": list(accuracy.turn_sd),
    }


def _discrepancy(result: StockingResult) -> dict[str, Any] | None:
    found = result.discrepancy
    if found is None:
        return None
    after = found.parameters_after
    return {
        "verdict": found.verdict,
        "named": list(found.named),
        "scores": [asdict(score) for score in found.scores],
        "places": [asdict(place) for place in found.places],
        "rms_before_mm": found.rms_before,
        "rms_after_mm": found.rms_after,
        "c10_after_kPa": None if after is None else [float(c) for c in mpa_to_kpa(after)],
    }


def _registration(result: StockingResult) -> dict[str, Any] | None:
    found = result.leg.registration
    if found is None:
        return None
    return {
        "rotation": found.transform.rotation.tolist(),
        "translation_mm": found.transform.translation.tolist(),
        "residual_rms_mm": found.residual,
        "pairs": found.pairs,
        "left_out": found.left_out,
        "shift_standard_error_mm": found.standard_error.tolist(),
        "turn_standard_error_deg": found.rotation_error.tolist(),
        "iterations": found.iterations,
        "converged": found.converged,
    }


def _stocking(result: StockingResult) -> dict[str, Any]:
    stocking, load, shape = result.leg.stocking, result.equilibrium.load, result.leg.bare
    return {
        "stiffness_N_per_mm": stocking.stiffness,
        "bending_length_mm": stocking.bending_length,
        "unstretched": {"levels_mm": stocking.levels.tolist(), "perimeters_mm": stocking.unstretched.tolist()},
        "levels_mm": shape.levels.tolist(),
        "perimeter_mm": load.perimeter.tolist(),
        "strain": load.strain.tolist(),
        "tension_N_per_mm": load.tension.tolist(),
        "mean_pressure_kPa": mpa_to_kpa(load.pressure.mean(axis=1)).tolist(),
        "share_of_skin_without_pressure": unloaded_skin(shape, load).tolist(),
    }


def pressure_along(result: StockingResult) -> PressureAlong:
    """Return the stocking's pressure by height."""
    leg, tension = result.leg, None if result.best is None else result.best.tension
    on_bare = stocking_load(leg.bare, leg.stocking).times(1.0 if tension is None else 1 + tension.value)
    return PressureAlong.of(leg.bare, result.equilibrium.load, on_bare, leg.accuracy)


def levels_of(result: StockingResult) -> list[LevelPressure]:
    """Return the pressure at every level of makers that the modelled part of the leg has."""
    return pressures_at_levels(pressure_along(result), result.leg.makers, result.leg.bare)


def _level(one: LevelPressure) -> dict[str, Any]:
    return {
        "level": one.level,
        "height_mm": one.height,
        "height_is_stated": one.stated,
        "mean_pressure_mmHg": one.mean,
        "ci95_mmHg": list(one.ci95),
        "over_pressure_at_B": one.over_ankle,
        "limits_mmHg": None if one.limits is None else list(one.limits),
        "verdict": one.verdict,
    }


def _pressures(result: StockingResult) -> dict[str, Any] | None:
    found = result.pressures
    if found is None:
        return None
    posture = result.leg.posture
    scanned = None if result.scan_load is None else mpa_to_kpa(result.scan_load.mean_pressure)
    return {
        "mean_interface_kPa": mpa_to_kpa(found.mean_interface),
        "least_interface_kPa": mpa_to_kpa(float(result.equilibrium.load.pressure.min())),
        "greatest_interface_kPa": mpa_to_kpa(found.greatest_interface),
        "mean_interface_of_scanned_shape_kPa": scanned,
        "mean_in_muscle_kPa": mpa_to_kpa(found.mean_in_muscle),
        "greatest_in_fat_kPa": mpa_to_kpa(found.greatest_in_fat),
        "greatest_in_fat_too_low_by": list(too_low_by(result.tetrahedra)),
        "greatest_in_fat_at_mm": found.greatest_in_fat_at.tolist(),
        "veins": [
            {
                "name": vein.name,
                "position_mm": vein.position.tolist(),
                "pressure_kPa": mpa_to_kpa(pressure),
                "standard_error_kPa": mpa_to_kpa(sd),
                "share_of_mean_interface": pressure / found.mean_interface,
                "inside_minus_tissue_kPa": {}
                if posture is None
                else {
                    name: mpa_to_kpa(inside - pressure)
                    for name, inside in posture.inside(float(vein.position[2])).items()
                },
            }
            for vein, pressure, sd in zip(result.leg.veins, found.at_veins, found.at_veins_sd, strict=True)
        ],
    }


def _sensor(one: ComparedSensor) -> dict[str, Any]:
    return {
        "name": one.sensor.name,
        "position_mm": one.sensor.position.tolist(),
        "diameter_mm": one.sensor.diameter,
        "measured_kPa": mpa_to_kpa(one.sensor.pressure),
        "measured_sd_kPa": mpa_to_kpa(one.sensor.sd),
        "model_kPa": mpa_to_kpa(one.pressure),
        "departure_in_standard_deviations": one.standardised_residual,
    }


def _fat(result: StockingResult, fat: FatPressures | None) -> dict[str, Any]:
    shape = result.leg.bare
    middle = int(np.argmin(np.abs(shape.levels - np.median(result.leg.slices))))
    thickness = fat_thickness_around(shape)
    pressed = (
        {}
        if fat is None
        else {
            "rank_correlation_of_greatest_pressure_with_thickness": fat.rank_correlation(fat.greatest, fat.thickness),
            "rank_correlation_of_greatest_pressure_with_interface": fat.rank_correlation(fat.greatest, fat.interface),
        }
    )
    return {
        "level_mm": float(shape.levels[middle]),
        "mean_thickness_mm": float(thickness[middle].mean()),
        "least_thickness_mm": float(thickness[middle].min()),
        "greatest_thickness_mm": float(thickness[middle].max()),
        "thickness_round_the_leg_mm": thickness[middle].tolist(),
        **pressed,
    }


def _model(result: StockingResult) -> dict[str, Any]:
    spaces, settings = result.model.compression.spaces, result.model.compression.settings
    return {
        "tetrahedra": result.tetrahedra,
        "unknowns": spaces.unknowns,
        "formulation": settings.formulation,
        "degree": settings.degree,
        "follower_load": settings.follower,
        "ends": settings.ends,
        "D1_per_MPa": {name: float(law.D1) for name, law in result.leg.tissues.items()},
    }


def _key(name: str) -> str:
    """Return a parameter's key: ``c10_deep`` of ``deep.C10``."""
    tissue, _, symbol = name.partition(".")
    return f"{symbol.lower()}_{tissue}"

"""``result.json`` of a fit: one object for every kind, its laws as members; units in names or beside numbers."""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from legfem.common.documents import json_types
from legfem.common.units import readable_unit
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, key_of, short_key_of, unit_of, unit_suffix, with_units
from legfem.inverse.claims import check_fits
from legfem.inverse.estimates import DISPLACEMENT, FORCE, Estimate
from legfem.inverse.fit import ChannelFit, Computed, Cost, Fit, OwnEstimate, TestFit
from legfem.inverse.trial import FullSolve

SCHEMA = "legfem.identify/3"


def members_of(value: Any, *names: str) -> dict[str, Any]:
    """Return some of a value's attributes as members of their names."""
    return {name: getattr(value, name) for name in names}


def fit_document(fits: Sequence[Fit[Any]]) -> dict[str, Any]:
    """Fits of one problem as JSON types.

    Parameters
    ----------
    fits
        One a law; what only their kind has is given by their details.
    """
    check_fits(fits)
    first = fits[0]
    document = {
        "schema": SCHEMA,
        "kind": first.kind,
        "subject": first.subject.id,
        **members_of(first.subject, "title", "origin"),
        "answer": (chosen := first.details.chosen(fits)).answer.document(),
        "chosen": chosen.law,
        "laws": {fit.law: _law(fit) for fit in fits},
        "versions": dict(first.versions),
    }
    plain: dict[str, Any] = json_types(document)
    return plain


def _law(fit: Fit[Any]) -> dict[str, Any]:
    log, unit = fit.log, fit.cost.reading_unit
    tests = [{**_test(fit, number), **fit.details.members_of_test(fit, number)} for number in range(len(fit.tests))]
    return {
        **fitted_document(fit),
        "tests": tests,
        # Of one test its curve stands beside the parameters too.
        **({"curve": tests[0]["curve"]} if len(tests) == 1 else {}),
        **fit.details.members(fit),
        **members_of(log, "converged", "forward_solves", "failed_solves", "factorisations", "seed", "wall_s"),
        "forward_solves_reused": log.reused_solves,
        f"emulator_error_{unit}": log.emulator_error,
        "search": {"solves": [_solve(solve, log.names, fit.cost.unit) for solve in log.solves]},
        "settings": dict(fit.settings),
    }


def fitted_document(fit: Fit[Any], key: Callable[[str], str] = key_of) -> dict[str, Any]:
    """What was found of a law and how it meets every test, whichever way it was searched for.

    Parameters
    ----------
    fit
        Of one law.
    key
        How a parameter of a full name is called.
    """
    keys = [key(name) for name in fit.estimates]
    return {
        **members_of(fit, "law", "identifiability", "weighting", "neo_hookean_limit"),
        "parameters": dict(zip(keys, map(estimate_document, fit.estimates.values()), strict=True)),
        "correlations": {
            key: dict(zip(keys, map(float, row), strict=True)) for key, row in zip(keys, fit.correlations, strict=True)
        },
        "assumed": with_units(fit.assumed),
        "notices": [asdict(one) for one in fit.notices],
        "goodness": asdict(fit.goodness),
        "agreement": {**asdict(fit.agreement), "intervals_widened_by": fit.agreement.birge_ratio},
        "cost": _cost(fit.cost),
        **({"computed": {key: _computed(one) for key, one in fit.computed.items()}} if fit.computed else {}),
        "tests": [_test(fit, number) for number in range(len(fit.tests))],
    }


def _test(fit: Fit[Any], number: int) -> dict[str, Any]:
    one: TestFit = fit.tests[number]
    first, *others = one.channels
    return {
        **members_of(one, "name", "fitted"),
        f"rms_{unit_suffix(first.channel.unit)}": first.rms,
        **members_of(first, "r_squared", "farthest_at"),
        "goodness": asdict(one.goodness),
        "by_itself": {key_of(name): _own(name, own) for name, own in one.by_itself.items()},
        "curve": _curve(first),
        **({"channels": {beside.channel.name: _beside(beside) for beside in others}} if others else {}),
    }


def _curve(one: ChannelFit) -> dict[str, Any]:
    """Measured and predicted readings of the first channel, and their derivatives: by stresses a kPa, by others a unit.

    Keys have the channel's name and unit: ``measured_force_N``.
    """
    name, unit = one.channel.name, unit_suffix(one.channel.unit)
    by_stress, others = {}, {}
    for parameter, values in one.sensitivities.items():
        of, factor = readable_unit(unit_of(parameter))
        if of == "kPa":
            by_stress[parameter] = values / factor
        else:
            others[parameter] = {"unit": of, f"{unit}_per_unit": values}
    return {
        one.channel.along: one.channel.station,
        f"{name}_{unit}": one.predicted,
        f"measured_{name}_{unit}": one.channel.values,
        f"measured_{name}_standard_error_{unit}": one.channel.sd,
        **({f"{name}_derivative_{unit}_per_kPa": by_stress} if by_stress else {}),
        **({f"{name}_derivative_by_others": others} if others else {}),
    }


def _beside(one: ChannelFit) -> dict[str, Any]:
    """Measured and predicted readings of a channel beside the first, in its unit."""
    return {
        "unit": one.channel.unit,
        one.channel.along: one.channel.station,
        "predicted": one.predicted,
        "measured": one.channel.values,
        "standard_error": one.channel.sd,
        "rms": one.rms,
    }


def _computed(one: Computed) -> dict[str, Any]:
    """A quantity that follows from a fit, its interval where it is known."""
    known = {"standard_error": one.standard_error, "ci95": list(one.ci95)} if math.isfinite(one.standard_error) else {}
    return {"name": one.name, "value": one.value, "unit": one.unit, **known}


def _own(name: str, found: OwnEstimate) -> dict[str, Any]:
    unit, factor = readable_unit(unit_of(name))
    return {
        "value": factor * found.value,
        "standard_error": factor * found.standard_error,
        "unit": unit,
        "departure_in_standard_errors": found.departure,
    }


def estimate_document(found: Estimate) -> dict[str, Any]:
    """An estimate in the unit in which people read it."""
    shown = found.shown
    return {
        **members_of(shown, "value", "unit", "standard_error"),
        "ci95": list(shown.ci95),
        "role": found.parameter.role,
        **members_of(found, "at_bound", "identifiability"),
        "share_of_squared_error": dict(found.error_shares),
        **({"share_of_information": dict(found.information_shares)} if found.information_shares else {}),
        "relative_change_if_fat_c10_is_10_percent_higher": found.moves.get("superficial.C10"),
        "relative_change_if_fascia_c10_is_10_percent_higher": found.moves.get("fascia.C10"),
        "relative_change_if_forces_are_10_percent_higher": found.moves.get(FORCE),
        "relative_change_if_displacements_are_10_percent_higher": found.moves.get(DISPLACEMENT),
    }


def _cost(cost: Cost) -> dict[str, Any]:
    return {
        **members_of(cost, "value", "unit", "definition", "points", "r_squared"),
        f"mean_square_{cost.unit}": cost.mean_square,
        **({"per_length_N2_per_mm2": cost.per_length} if cost.unit == "N2" else {}),
        f"rms_{cost.reading_unit}": cost.rms,
        **members_of(cost, "minimised", "minimised_value", "minimised_unit"),
    }


def _solve(solve: FullSolve, free: Sequence[str], unit: str) -> dict[str, Any]:
    """C10 and C20 of the deep tissue and what else is free, keys with units, and how the solve went."""
    named = dict.fromkeys((DEEP_C10, DEEP_C20, *free))
    values = with_units({name: solve.values[name] for name in named if name in solve.values}, short_key_of)
    told = members_of(solve, "stage", "complete", "reason", "factorisations", "seconds")
    return {**values, f"cost_{unit}": solve.cost, **told}

"""Numbers of a leg's sites as ``result.json`` has them."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from legfem.common.documents import json_types
from legfem.common.doubts import doubt_documents
from legfem.common.units import readable_unit
from legfem.identify.document import searched_document
from legfem.inverse.catalogue import key_of, unit_of, with_units
from legfem.sites.result import SiteFit, SitesResult

SCHEMA = "legfem.identify-sites/1"


def sites_document(result: SitesResult) -> dict[str, Any]:
    """Return a result as JSON types; every number's unit is in its name or beside it."""
    document = {
        "schema": SCHEMA,
        "subject": result.leg.id,
        "title": result.leg.title,
        "origin": result.leg.origin,
        **searched_document(result),
        "doubts": doubt_documents(result.doubts),
        "assumed": with_units(result.assumed),
        "own_errors_of_sites_sd": with_units(result.own_errors),
        "sites": {one.name: _site(one) for one in result.sites},
        "misfit": asdict(result.misfit),
        "agreement_of_sites": {**asdict(result.agreement), "intervals_widened_by": result.agreement.birge_ratio},
        "neo_hookean_limit": result.neo_hookean_limit,
        "failed_solves": result.failed_solves,
        "model": "2d" if result.spatial is None else "3d",
        "spatial": None if result.spatial is None else asdict(result.spatial),
    }
    plain: dict[str, Any] = json_types(document)
    return plain


def _site(one: SiteFit) -> dict[str, Any]:
    correction = one.correction
    return {
        "subject": one.subject.id,
        "trials": one.measured.n_trials,
        "rms_N": one.rms,
        "r_squared": one.r_squared,
        "misfit": asdict(one.misfit),
        "by_itself": {key_of(name): _by_itself(name, one) for name in one.by_itself},
        "correction": None if correction is None else correction.name,
        "curve": {
            "displacement_mm": one.measured.displacement,
            "measured_force_N": one.measured.force,
            "measured_force_standard_error_N": one.measured.force_sd,
            "force_N": one.predicted,
            "correction_P": None if correction is None else correction.P,
            "correction_P_sd": None if correction is None else correction.sd,
        },
    }


def _by_itself(name: str, one: SiteFit) -> dict[str, Any]:
    unit, factor = readable_unit(unit_of(name))
    found = one.by_itself[name]
    return {
        "value": factor * found.value,
        "standard_error": factor * found.standard_error,
        "unit": unit,
        "departure_in_standard_errors": found.departure,
    }

"""Numbers of specimens as ``result.json`` has them."""

from __future__ import annotations

from typing import Any

from legfem.common.documents import json_types
from legfem.identify.document import searched_document
from legfem.inverse.catalogue import with_units
from legfem.specimens.result import ComparedRecording, SpecimenResult

SCHEMA = "legfem.identify-specimen/1"


def specimen_document(result: SpecimenResult) -> dict[str, Any]:
    """Return a result as JSON types; every number's unit is in its name or beside it."""
    document = {
        "schema": SCHEMA,
        "specimen": result.folder.id,
        "title": result.folder.title,
        "origin": result.folder.origin,
        **searched_document(result),
        "assumed": with_units(result.assumed),
        "recordings": [_recording(one) for one in result.recordings],
        "not_used": {one.name: one.reason for one in result.left_out},
        "chi_square": result.chi_square,
        "degrees_of_freedom": result.degrees_of_freedom,
        "p_value": result.p_value,
        "gain_sd_between_recordings": result.gain_sd,
        "stiffness_over_typical": dict(result.stiffness),
        "stiffness_log_sd": result.stiffness_spread,
        "failed_solves": result.failed_solves,
    }
    plain: dict[str, Any] = json_types(document)
    return plain


def _recording(one: ComparedRecording) -> dict[str, Any]:
    course = one.course
    return {
        "name": one.name,
        "specimen": one.specimen,
        "fitted": one.fitted,
        "rate_mm_per_s": course.rate,
        "depth_mm": course.depth,
        "rmse_N": one.rmse,
        "r_squared": one.r_squared,
        "scale": one.scale,
        "r_squared_at_that_scale": one.shape_r_squared,
        "time_s": course.time,
        "displacement_mm": course.displacement,
        "force_N": course.force,
        "predicted_force_N": one.predicted,
    }

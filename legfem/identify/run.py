"""Identification of a subject with one section, its solves kept in a folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from legfem.common.documents import write_document
from legfem.identify.document import result_document
from legfem.identify.result import IdentificationResult, identification_result
from legfem.inverse.fit import fit
from legfem.inverse.laws import LawName
from legfem.inverse.outcome import JointForward
from legfem.inverse.settings import SearchRequest
from legfem.legs.correction import TabulatedCorrection
from legfem.legs.forward import PlaneStrainForward
from legfem.legs.identification import as_leg, confirmed_in_3d
from legfem.legs.problem import leg_problem, pressed_depth
from legfem.legs.subject import Subject

if TYPE_CHECKING:
    from legfem.experiments.plane_strain import PlaneStrainSettings
    from legfem.legs.model_3d import LegModels


def identify_subject(
    subject: Subject,
    laws: Sequence[LawName],
    request: SearchRequest | None = None,
    correction: TabulatedCorrection | None = None,
    model: PlaneStrainForward | None = None,
    leg: LegModels | None = None,
) -> list[IdentificationResult]:
    """Identify a subject's tissues, and its instrument, from the recordings; see `legfem.legs.identification`."""
    request = request or SearchRequest()
    model = model or forward_model(subject, request)
    problem = leg_problem(as_leg(subject), laws, request, [correction], JointForward((model,)))
    found = fit(problem, laws, request) if leg is None else confirmed_in_3d(problem, laws, request, leg)
    return [identification_result(one) for one in found]


def forward_model(
    subject: Subject, request: SearchRequest, settings: PlaneStrainSettings | None = None
) -> PlaneStrainForward:
    """Forward model of a subject, pressed as deep as a request asks."""
    return PlaneStrainForward.of_subject(subject, pressed_depth(subject, request), settings)


def write_results(results: Sequence[IdentificationResult], out: Path, as_list: bool) -> Path:
    """Write ``result.json``, whole or not at all, and return its path."""
    documents = [result_document(result) for result in results]
    return write_document(out / "result.json", documents if as_list else documents[0])

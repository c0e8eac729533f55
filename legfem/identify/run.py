"""Identification of a subject with the plane-strain model, its solves kept in a folder."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from legfem.common.documents import write_document
from legfem.common.errors import InputError
from legfem.correction.tabulated import TabulatedCorrection
from legfem.identify.document import result_document
from legfem.identify.identification import Identification, beyond_of, measured_curve, weighting_of
from legfem.identify.result import IdentificationResult
from legfem.inverse.catalogue import DEEP_C20, Values
from legfem.inverse.laws import IdentifiedLaw, LawName
from legfem.inverse.parameter import Parameter
from legfem.inverse.settings import SearchRequest
from legfem.legs.forward import PlaneStrainForward
from legfem.legs.laws import law_of
from legfem.legs.subject import Subject

if TYPE_CHECKING:
    from legfem.experiments.plane_strain import PlaneStrainSettings
    from legfem.identify.spatial import LegModels


def identify_subject(
    subject: Subject,
    laws: Sequence[LawName],
    request: SearchRequest | None = None,
    correction: TabulatedCorrection | None = None,
    model: PlaneStrainForward | None = None,
    leg: LegModels | None = None,
) -> list[IdentificationResult]:
    """Identify a subject's tissues, and its instrument, from the recordings.

    Parameters
    ----------
    subject : Subject
        With recordings.
    laws : sequence of str
        Of the deep tissue: ``neo-hookean``, ``reduced-polynomial``.
    request : SearchRequest, optional
        What to identify, and with what means.
    correction : TabulatedCorrection, optional
        For 3D effects.
    model : PlaneStrainForward, optional
        The subject's forward model, see `forward_model`; made without it.
    leg : LegModels, optional
        The leg in 3D, pressed as deep as the model: full solves of it confirm the correction and
        take its place. See `legfem.identify.two_fidelity`.

    Raises
    ------
    InputError
        If the subject can't be meshed or the recordings can't be used, or there is no parameter of
        a name.
    SearchError
        If too few full solves reach the measured depth.
    """
    request = request or SearchRequest()
    measured = measured_curve(subject, request.depth)
    model = model or forward_model(subject, request)
    chosen = laws_of(subject, laws, model.nominal, request.parameters, request.fixed)
    for law in chosen.values():
        weighting_of(law, request.settings.weighting)
    with request.solver(model, chosen) as solver:
        found = Identification(subject, measured, chosen, solver, request.settings, correction)
        if leg is None:
            return found.identify(laws)
        from legfem.identify.two_fidelity import TwoFidelities

        return TwoFidelities(found, leg, request.progress, correction).identify(laws)


def forward_model(
    subject: Subject, request: SearchRequest, settings: PlaneStrainSettings | None = None
) -> PlaneStrainForward:
    """Return a subject's forward model, pressed as deep as a request asks.

    Raises
    ------
    InputError
        If the recordings can't be used.
    """
    end = float(measured_curve(subject, request.depth).displacement[-1])
    beyond = beyond_of(request.parameters or (), request.fixed)
    return PlaneStrainForward.of_subject(subject, end + beyond, settings)


def laws_of(
    subject: Subject,
    names: Sequence[LawName],
    nominal: Values,
    parameters: Sequence[Parameter] | None = None,
    fixed: Values | None = None,
) -> dict[LawName, IdentifiedLaw]:
    """Return the laws asked for, and the neo-Hookean one if it is the limit of another.

    Raises
    ------
    InputError
        For a name that the model hasn't, or a stiffness that is neither free nor given.
    """
    laws = {name: law_of(name, subject, nominal, parameters, fixed) for name in names}
    stiffening = any(law.index(DEEP_C20) is not None for law in laws.values())
    if stiffening and "neo-hookean" not in laws:
        with suppress(InputError):
            laws["neo-hookean"] = law_of("neo-hookean", subject, nominal, parameters, fixed)
    return laws


def write_results(results: Sequence[IdentificationResult], out: Path, as_list: bool) -> Path:
    """Write ``result.json``, whole or not at all, and return its path."""
    documents = [result_document(result) for result in results]
    return write_document(out / "result.json", documents if as_list else documents[0])

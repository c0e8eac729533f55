"""Identification of a subject with the plane-strain model, its solves kept in a folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from legfem.common.documents import write_document
from legfem.common.errors import InputError
from legfem.common.progress import Progress, Silent
from legfem.correction.tabulated import TabulatedCorrection
from legfem.identify.catalogue import DEEP_C20, Values
from legfem.identify.document import result_document
from legfem.identify.forward import ForwardOutcome, PlaneStrainForward
from legfem.identify.identification import (
    Identification,
    beyond_of,
    measured_curve,
    weighting_of,
)
from legfem.identify.laws import IdentifiedLaw, LawName, law_of
from legfem.identify.result import IdentificationResult
from legfem.identify.settings import IdentificationSettings
from legfem.identify.solver import FullSolver
from legfem.inference.parameter import Parameter
from legfem.jobs.store import Store
from legfem.subjects.subject import Subject

if TYPE_CHECKING:
    from legfem.experiments.plane_strain import PlaneStrainSettings
    from legfem.identify.spatial import LegModels

ALWAYS_BY = ("deep.C10", "deep.C20", "superficial.C10", "fascia.C10")
"""What every solve differentiates the force by: the back-substitutions cost next to nothing."""


def identify_subject(
    subject: Subject,
    laws: Sequence[LawName],
    settings: IdentificationSettings | None = None,
    correction: TabulatedCorrection | None = None,
    out: Path | None = None,
    jobs: int = 1,
    depth: float | None = None,
    progress: Progress | None = None,
    model: PlaneStrainForward | None = None,
    parameters: Sequence[Parameter] | None = None,
    fixed: Values | None = None,
    leg: LegModels | None = None,
) -> list[IdentificationResult]:
    """Identify a subject's tissues, and its instrument, from the recordings.

    Parameters
    ----------
    subject : Subject
        With recordings.
    laws : sequence of str
        Of the deep tissue: ``neo-hookean``, ``reduced-polynomial``.
    settings : IdentificationSettings, optional
        Of the search.
    correction : TabulatedCorrection, optional
        For 3D effects.
    out : Path, optional
        Folder in whose ``solves`` every full solve is kept; none is without it.
    jobs : int
        Processes.
    depth : float, optional
        Greatest displacement to use, mm.
    progress : Progress, optional
        Told of every full solve.
    model : PlaneStrainForward, optional
        The subject's forward model, see `forward_model`; made without it.
    parameters : sequence of Parameter, optional
        What to identify, or with the role "nuisance" only to let err, in the model's units; of
        these a law takes what it has. C10 and C20 of the deep tissue without them;
        `legfem.identify.catalogue.parameter_of` makes one with bounds that suit legs.
    fixed : Mapping[str, float], optional
        Values that are held, in place of those that the folder gives.
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
    settings = settings or IdentificationSettings()
    measured = measured_curve(subject, depth)
    model = model or forward_model(subject, depth, parameters, fixed)
    chosen = laws_of(subject, laws, model.nominal, parameters, fixed)
    for law in chosen.values():
        weighting_of(law, settings.weighting)
    progress = progress or Silent()
    progress.stage("meshing; on a machine's first run, compiling forms (some 20 s)")
    # Also compiles once for all processes, and finds what can't be meshed before files are made.
    model.prepare()
    store = None if out is None else Store(out / "solves", ForwardOutcome, model.fingerprint())
    with FullSolver(model, store, jobs, progress, sensitivities_of(chosen)) as solver:
        found = Identification(subject, measured, chosen, solver, settings, correction)
        if leg is None:
            return found.identify(laws)
        from legfem.identify.two_fidelity import TwoFidelities

        return TwoFidelities(found, leg, progress, correction).identify(laws)


def forward_model(
    subject: Subject,
    depth: float | None = None,
    parameters: Sequence[Parameter] | None = None,
    fixed: Values | None = None,
    settings: PlaneStrainSettings | None = None,
) -> PlaneStrainForward:
    """Return a subject's forward model, pressed as deep as the arguments of `identify_subject` ask.

    Raises
    ------
    InputError
        If the recordings can't be used.
    """
    end = float(measured_curve(subject, depth).displacement[-1])
    beyond = beyond_of(parameters or (), fixed or {})
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


def sensitivities_of(laws: Mapping[LawName, IdentifiedLaw]) -> tuple[str, ...]:
    """Return the model's parameters that solves differentiate the force by."""
    free = (law.names[k] for law in laws.values() for k in law.of_model)
    return tuple(dict.fromkeys((*ALWAYS_BY, *free)))


def write_results(results: Sequence[IdentificationResult], out: Path, as_list: bool) -> Path:
    """Write ``result.json``, whole or not at all, and return its path."""
    documents = [result_document(result) for result in results]
    return write_document(out / "result.json", documents if as_list else documents[0])

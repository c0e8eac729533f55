"""Identification of a subject with the plane-strain model, its solves kept in a folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from legfem.documents import write_document
from legfem.identify.correction import Correction
from legfem.identify.forward import PlaneStrainForward
from legfem.identify.identification import Identification, measured_curve
from legfem.identify.result import IdentificationResult, LawName
from legfem.identify.settings import IdentificationSettings
from legfem.identify.solver import FullSolver
from legfem.identify.store import SolveStore
from legfem.progress import Progress, Silent
from legfem.subject import Subject


def identify_subject(
    subject: Subject,
    laws: Sequence[LawName],
    settings: IdentificationSettings | None = None,
    correction: Correction | None = None,
    out: Path | None = None,
    jobs: int = 1,
    depth: float | None = None,
    progress: Progress | None = None,
    model: PlaneStrainForward | None = None,
) -> list[IdentificationResult]:
    """Identify a subject's deep tissue from its recordings.

    Parameters
    ----------
    subject : Subject
        With recordings.
    laws : sequence of str
        ``neo-hookean``, ``reduced-polynomial``.
    settings : IdentificationSettings, optional
        Of the search.
    correction : Correction, optional
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
        The subject's forward model, pressed to the measured curve's depth; made without it.

    Raises
    ------
    InputError
        If the subject can't be meshed or the recordings can't be used.
    SearchError
        If too few full solves reach the measured depth.
    """
    measured = measured_curve(subject, depth)
    model = model or PlaneStrainForward.of_subject(subject, float(measured.displacement[-1]))
    progress = progress or Silent()
    progress.stage("meshing; on a machine's first run, compiling forms (some 20 s)")
    # Also compiles once for all processes, and finds what can't be meshed before files are made.
    model.prepare()
    store = None if out is None else SolveStore(out / "solves", model.fingerprint())
    with FullSolver(model, store, jobs, progress) as solver:
        found = Identification(
            subject, measured, solver, settings or IdentificationSettings(), correction
        )
        return found.identify(laws)


def write_results(results: Sequence[IdentificationResult], out: Path, as_list: bool) -> Path:
    """Write ``result.json``, whole or not at all, and return its path."""
    documents = [result.to_json() for result in results]
    return write_document(out / "result.json", documents if as_list else documents[0])

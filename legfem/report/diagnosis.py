"""The report of a diagnosis: text and figures in one folder."""

from __future__ import annotations

import shutil
from pathlib import Path

from legfem.diagnose.diagnosis import Diagnosis
from legfem.diagnose.document import Recorded
from legfem.report.diagnosis_text import diagnosis_page
from legfem.report.page import ReportFile
from legfem.report.parameter_figure import parameter_figure
from legfem.report.ranking_figure import ranking_figure, score_figure
from legfem.report.recording_figure import recording_figure
from legfem.report.signature_figure import leading, signature_figure
from legfem.report.style import save

REPORT = "report.txt"
_UNFINISHED = ".report-unfinished"


def write_diagnosis_report(diagnosis: Diagnosis, subject: Recorded, out: Path) -> Path:
    """Write report.txt and the figures of a diagnosis.

    Everything is made in a hidden folder first and moved into place at the end, the report last:
    whoever stops the run in between finds no half-written file.

    Parameters
    ----------
    diagnosis
        What was found.
    subject
        Whose recordings they are.
    out
        Folder; made if missing.

    Returns
    -------
    Path
        Of report.txt.
    """
    out = Path(out)
    folder = out / _UNFINISHED
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    try:
        entries = _figures(diagnosis, subject, folder)
        page = diagnosis_page(diagnosis, subject, entries)
        (folder / REPORT).write_text(page, encoding="utf-8")
        for path in [path for entry in entries for path in entry.paths] + [folder / REPORT]:
            path.replace(out / path.name)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return out / REPORT


def _figures(found: Diagnosis, subject: Recorded, folder: Path) -> list[ReportFile]:
    whose = subject.title, subject.origin
    entries = []
    several = len(found.observed.protocols) > 1
    for number, stations in enumerate(found.observed.protocols):
        name = f"recording-{number + 1}" if several else "recording"
        entries.append(
            ReportFile(
                save(recording_figure(found, number, *whose), folder, name),
                f"recordings ({stations.label}) against the model, what it misses, and where",
            )
        )
    if found.verdict == "consistent":
        if found.base.assessment.scores:
            figure = score_figure(found, *whose)
            shows = "p-values of the mechanisms' score tests"
            entries.append(ReportFile(save(figure, folder, "tests", svg=True), shows))
    else:
        if leading(found):
            figure = signature_figure(found, *whose)
            shows = "what the base model misses, and what each leading mechanism would leave"
            entries.append(ReportFile(save(figure, folder, "signatures"), shows))
        figure = ranking_figure(found, *whose)
        shows = "refits with mechanisms, alone and in pairs, by Schwarz' criterion (BIC)"
        entries.append(ReportFile(save(figure, folder, "ranking", svg=True), shows))
    figure = parameter_figure(found, *whose)
    shows = "the parameters with their 95 % intervals, before and after"
    entries.append(ReportFile(save(figure, folder, "parameters", svg=True), shows))
    return entries

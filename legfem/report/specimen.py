"""The report of specimens: text, page, figure and numbers in one folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from legfem.common.documents import write_document
from legfem.report.in_place import REPORT, made_in_place
from legfem.report.listing import RESULT, ReportFile
from legfem.report.plain import plain_page
from legfem.report.specimen_figure import specimen_figure
from legfem.report.specimen_numbers import specimen_document
from legfem.report.style import save
from legfem.report.web.page import listed, write_page
from legfem.report.web.specimen import specimen_web_page
from legfem.specimens.result import SpecimenResult


def write_specimen_report(results: Sequence[SpecimenResult], out: Path, command: str = "") -> Path:
    """Write result.json, fit.png, fit.svg, report.html and report.txt; return the latter's path.

    Parameters
    ----------
    results
        One a law, of one folder.
    out
        Folder; made if missing.
    command
        That was given, for who wants to repeat it.
    """
    write_document(out / "result.json", [specimen_document(result) for result in results])
    with made_in_place(out) as folder:
        figure = ReportFile(
            save(specimen_figure(results), folder, "fit", svg=True),
            "every recording beside the model over displacement and time, and their differences",
        )
        page = specimen_web_page(results, command)
        write_page(page, folder, plain_page(page, [listed("curves"), figure, RESULT]))
    return out / REPORT

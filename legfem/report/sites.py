"""The report of a leg's sites: text, page, figures and numbers in one folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from legfem.common.documents import write_document
from legfem.report.in_place import REPORT, made_in_place
from legfem.report.listing import RESULT, ReportFile
from legfem.report.placement_figure import SECTION_SHOWS, placement_figure
from legfem.report.plain import plain_page
from legfem.report.sites_figure import sites_figure
from legfem.report.sites_numbers import sites_document
from legfem.report.style import LAW_NAMES, save
from legfem.report.web.page import listed, write_page
from legfem.report.web.sites import sites_web_page
from legfem.sites.result import SitesResult


def write_sites_report(results: Sequence[SitesResult], out: Path, command: str = "") -> tuple[Path, Path]:
    """Write result.json, the figures, report.html and report.txt; return the JSON's and last path.

    Parameters
    ----------
    results
        One a law, of one leg.
    out
        Folder; made if missing.
    command
        That was given, for who wants to repeat it.
    """
    documents = [sites_document(result) for result in results]
    path = write_document(out / "result.json", documents if len(documents) > 1 else documents[0])
    with made_in_place(out) as folder:
        files = [listed("curves")]
        for result in results:
            drawn = save(sites_figure(result), folder, f"fit-{result.law}", svg=True)
            shows = f"every site beside the {LAW_NAMES[result.law]} law, and their differences"
            files.append(ReportFile(drawn, shows))
        for site in results[0].leg.sites:
            name = site.site or "leg"
            drawn = save(placement_figure(site), folder, f"section-{name}")
            files.append(ReportFile(drawn, f"{name}: {SECTION_SHOWS}"))
        page = sites_web_page(results, command)
        write_page(page, folder, plain_page(page, [*files, RESULT]))
    return path, out / REPORT

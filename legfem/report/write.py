"""A page in all forms that stand in a command's folder."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from legfem.report.folder import REPORT, ReportFile
from legfem.report.page import PAGE, WebPage, listed
from legfem.report.render.html import rendered
from legfem.report.render.markdown import MARKDOWN, markdown_page
from legfem.report.render.table import CSV, WORKBOOK, write_tables
from legfem.report.render.text import plain_page

if TYPE_CHECKING:
    import pandas as pd

PAGE_FILES = (REPORT, PAGE, MARKDOWN, CSV, WORKBOOK)
"""Files that `write_page` writes."""


def write_page(
    page: WebPage, folder: Path, explore: str, files: Sequence[ReportFile], estimates: "pd.DataFrame | None" = None
) -> None:
    """Write ``report.html``, ``report.txt``, ``report.md``, ``numbers.csv`` and ``numbers.xlsx``.

    Parameters
    ----------
    page
        What they say.
    folder
        Where they go.
    explore
        What there is to explore on the page for a browser, in words.
    files
        What else stands in the folder.
    estimates
        A row a parameter; the page's known numbers without it.
    """
    (folder / PAGE).write_text(rendered(page), encoding="utf-8")
    (folder / MARKDOWN).write_text(markdown_page(page), encoding="utf-8")
    tables = write_tables(page, folder, estimates)
    markdown = ReportFile([Path(MARKDOWN)], "the same as Markdown")
    every = [listed(explore), markdown, *files, tables]
    (folder / REPORT).write_text(plain_page(page, every), encoding="utf-8")

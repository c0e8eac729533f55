"""Numbers of a page as tables for a spreadsheet: ``numbers.csv`` and ``numbers.xlsx``."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from legfem.common.documents import literal
from legfem.inverse.catalogue import key_of
from legfem.inverse.fit import Fit
from legfem.report.folder import ReportFile
from legfem.report.page import WebPage

if TYPE_CHECKING:
    import pandas as pd

CSV, WORKBOOK = "numbers.csv", "numbers.xlsx"


def estimates_frame(fits: Sequence[Fit[Any]]) -> "pd.DataFrame":
    """A row a parameter, or what was computed with them, and law: value, 95 % interval, unit and verdict."""
    import pandas as pd

    rows: list[tuple[Any, ...]] = []
    for fit in fits:
        for name, found in fit.estimates.items():
            shown = found.shown
            rows.append((fit.law, key_of(name), shown.value, *shown.ci95, shown.unit, found.identifiability))
        for key, one in fit.computed.items():
            rows.append((fit.law, key, one.value, *one.ci95, one.unit, ""))
    return pd.DataFrame(rows, columns=["law", "parameter", "value", "low", "high", "unit", "identifiability"])


def write_tables(page: WebPage, folder: Path, estimates: "pd.DataFrame | None" = None) -> ReportFile:
    """Write a page's numbers as CSV and as a workbook.

    Parameters
    ----------
    page
        Its known numbers, with where they come from, are the workbook's second sheet, and all of a page without
        estimates.
    folder
        Where the files go.
    estimates
        A row a parameter, with numbers as numbers.
    """
    import pandas as pd

    known = _frame(vars(one) for one in page.known)
    first = known if estimates is None else _frame(row._asdict() for row in estimates.itertuples(index=False))
    csv, workbook = folder / CSV, folder / WORKBOOK
    first.assign(subject=literal(page.subject), origin=page.origin).to_csv(csv, index=False)
    with pd.ExcelWriter(workbook) as writer:
        if estimates is not None:
            first.to_excel(writer, sheet_name="estimates", index=False)
        known.to_excel(writer, sheet_name="numbers", index=False)
    shows = "the numbers, with intervals and verdicts, for a spreadsheet"
    return ReportFile([csv, workbook], shows)


def _frame(rows: Iterable[Mapping[str, Any]]) -> "pd.DataFrame":
    import pandas as pd

    return pd.DataFrame([{name: literal(value) for name, value in row.items()} for row in rows])

"""Estimates as a table for a spreadsheet: numbers.csv and numbers.xlsx."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from legfem.inverse.catalogue import key_of
from legfem.inverse.fit import Fit
from legfem.report.folder import ReportFile
from legfem.report.page import WebPage

if TYPE_CHECKING:
    import pandas as pd


def estimates_frame(fits: Sequence[Fit[Any]]) -> pd.DataFrame:
    """A row a parameter and law: value, 95 % interval, unit and verdict."""
    import pandas as pd

    return pd.DataFrame(
        [
            {
                "law": fit.law,
                "parameter": key_of(name),
                "value": found.shown.value,
                "low": found.shown.ci95[0],
                "high": found.shown.ci95[1],
                "unit": found.shown.unit,
                "identifiability": found.identifiability,
            }
            for fit in fits
            for name, found in fit.estimates.items()
        ]
    )


def write_tables(page: WebPage, fits: Sequence[Fit[Any]], folder: Path) -> ReportFile:
    """Write the estimates, and all numbers of a page with where they come from, as CSV and as a workbook."""
    import pandas as pd

    frame = estimates_frame(fits).assign(subject=fits[0].subject.id, origin=fits[0].subject.origin)
    known = pd.DataFrame([vars(one) for one in page.known])
    csv, workbook = folder / "numbers.csv", folder / "numbers.xlsx"
    frame.to_csv(csv, index=False)
    with pd.ExcelWriter(workbook) as writer:
        frame.to_excel(writer, sheet_name="estimates", index=False)
        known.to_excel(writer, sheet_name="numbers", index=False)
    return ReportFile([csv, workbook], "the estimates, with intervals and verdicts, for a spreadsheet")

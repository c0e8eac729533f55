"""Tables in Excel's workbooks."""

from __future__ import annotations

from pathlib import Path

from openpyxl import load_workbook

from legfem.recording.formats.sheet import Cell, Sheet, sheet_of_rows


def read_workbook(path: Path) -> list[Sheet]:
    """Read the tables of a workbook's sheets; sheets without one are passed over."""
    book = load_workbook(path, read_only=True, data_only=True)
    try:
        found = [
            sheet_of_rows(
                path, page.title, [[_cell(c) for c in r] for r in page.iter_rows(values_only=True)]
            )
            for page in book.worksheets
        ]
    finally:
        book.close()
    return [sheet for sheet in found if sheet is not None]


def _cell(value: object) -> Cell:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    return None if value is None else str(value)

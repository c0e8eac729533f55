"""Tables in Excel's workbooks."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path

import xlrd
from openpyxl import load_workbook

from legfem.data.formats.sheet import Cell, Sheet, check_size, sheet_of_rows

_NUMBER = re.compile(r"\s*[+-]?\d+([.,]\d+)?([eE][+-]?\d+)?\s*")
_IN_THOUSANDS = re.compile(r"\s*[+-]?[1-9]\d{0,2}[.,]\d{3}\s*")


def read_workbook(path: Path) -> list[Sheet]:
    """Read the tables of a workbook's sheets; sheets without one are passed over."""
    with zipfile.ZipFile(path) as archive:
        check_size(path, sum(one.file_size for one in archive.infolist()))
    book = load_workbook(path, read_only=True, data_only=True)
    try:
        found = [_table(path, page.title, page.iter_rows(values_only=True)) for page in book.worksheets]
    finally:
        book.close()
    return [sheet for sheet in found if sheet is not None]


def read_old_workbook(path: Path) -> list[Sheet]:
    """Read the tables of a workbook as Excel wrote them up to 2003."""
    with xlrd.open_workbook(path, on_demand=True) as book:
        pages = [(page.name, [page.row_values(k) for k in range(page.nrows)]) for page in book.sheets()]
    found = [_table(path, name, rows) for name, rows in pages]
    return [sheet for sheet in found if sheet is not None]


def _table(path: Path, name: str, given: Iterable[Sequence[object]]) -> Sheet | None:
    rows = [[_cell(value) for value in row] for row in given]
    mark = _decimal_mark(rows)
    if mark is None:
        return sheet_of_rows(path, name, rows)
    words = "points" if mark == "." else "commas"
    remark = f"numbers are text with decimal {words}: so they are complete"
    return sheet_of_rows(path, name, [[_number(c, mark) for c in row] for row in rows], (remark,))


def _cell(value: object) -> Cell:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    return None if value is None else str(value)


def _decimal_mark(rows: Sequence[Sequence[Cell]]) -> str | None:
    """Return the mark in numbers that are text; None where there are none, or it isn't clear.

    As a workbook has them that was made under another country's settings.
    """
    texts = [cell for row in rows for cell in row if isinstance(cell, str)]
    marked = [text for text in texts if _NUMBER.fullmatch(text) and ("," in text or "." in text)]
    if not marked or all(_IN_THOUSANDS.fullmatch(text) for text in marked):
        return None
    marks = {"," if "," in text else "." for text in marked}
    return marks.pop() if len(marks) == 1 else None


def _number(cell: Cell, mark: str) -> Cell:
    if isinstance(cell, str) and _NUMBER.fullmatch(cell):
        return float(cell.replace(mark, "."))
    return cell

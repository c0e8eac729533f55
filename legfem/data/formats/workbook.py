"""Tables in workbooks: Excel's, and OpenDocument's (``.ods``).

Libraries that read OpenDocument expand what a file says of repeated cells before they are asked for, beyond any memory;
here rows are read one by one. Source: OASIS, *OpenDocument v1.3, part 3*, sections 9.1 and 19.
"""

import re
import sys
import zipfile
from collections.abc import Iterable, Sequence
from datetime import timedelta
from pathlib import Path
from xml.etree import ElementTree

from openpyxl.reader.excel import ExcelReader

from legfem.common.errors import InputError
from legfem.data.formats.headings import Cell
from legfem.data.formats.sheet import FEWEST_ROWS, NOT_CALCULATED, Sheet, check_size, sheet_of_rows, why_no_number

_NUMBER = re.compile(r"\s*[+-]?\d+([.,]\d+)?([eE][+-]?\d+)?\s*")
_MOST_COLUMNS = 1_000
_PAGE = re.compile(r"xl/worksheets/[^/]+\.xml")
_NO_VALUE = re.compile(rb"(?:</f>|<f[^<>]*/>)(?:<v\s*/>|<v></v>)?</c>")
_IN_THOUSANDS = re.compile(r"\s*[+-]?[1-9]\d{0,2}[.,]\d{3}\s*")


class _Tables(ExcelReader):
    """openpyxl's reader, which fails at a sheet of charts that has none."""

    def read_chartsheet(self, sheet: object, rel: object) -> None:
        """Pass over a sheet that contains no table."""


def read_workbook(path: Path) -> list[Sheet]:
    """Read the tables of a workbook's sheets; sheets without one are passed over."""
    with zipfile.ZipFile(path) as archive:
        check_size(path, sum(one.file_size for one in archive.infolist()))
        empty = sum(len(_NO_VALUE.findall(archive.read(one))) for one in archive.namelist() if _PAGE.fullmatch(one))
    remarks = (f"{empty} {NOT_CALCULATED}",) if empty else ()
    # openpyxl asks the name of a file, which may be another, and not of its content.
    with path.open("rb") as content:
        reader = _Tables(content, read_only=True, data_only=True)
        reader.read()
        book = reader.wb
        shown = [page for page in book.worksheets if page.sheet_state == "visible"]
        for page in shown:
            page.reset_dimensions()  # as other programs state them they may be wrong
        try:
            return _tables(path, ((page.title, page.iter_rows(values_only=True)) for page in shown), remarks)
        finally:
            book.close()


def read_old_workbook(path: Path) -> list[Sheet]:
    """Read the tables of a workbook as Excel wrote them up to 2003."""
    import xlrd

    def value(cell: xlrd.sheet.Cell, datemode: int) -> object:
        return xlrd.xldate_as_datetime(cell.value, datemode) if cell.ctype == xlrd.XL_CELL_DATE else cell.value

    # By default it would write to what was sys.stdout when it was imported.
    with xlrd.open_workbook(path, logfile=sys.stdout, on_demand=True) as book:
        pages = [
            (page.name, [[value(cell, book.datemode) for cell in page.row(k)] for k in range(page.nrows)])
            for page in book.sheets()
            if page.visibility == 0
        ]
    return _tables(path, pages)


_OFFICE = "{urn:oasis:names:tc:opendocument:xmlns:office:1.0}"
_TABLE = "{urn:oasis:names:tc:opendocument:xmlns:table:1.0}"
_TEXT = "{urn:oasis:names:tc:opendocument:xmlns:text:1.0}"
_SPAN = re.compile(r"PT(?P<h>\d+)H(?P<m>\d+)M(?P<s>[\d.]+)S")


def read_open_document(path: Path) -> list[Sheet]:
    """Read the tables of an OpenDocument workbook's sheets."""
    pages: list[tuple[str, list[list[Cell]]]] = []
    with zipfile.ZipFile(path) as archive, archive.open("content.xml") as content:
        check_size(path, sum(one.file_size for one in archive.infolist()))
        rows: list[list[Cell]] = []
        cells = 0
        for _, element in ElementTree.iterparse(content):
            if element.tag == f"{_TABLE}table-row":
                row = _open_row(element)
                times = int(element.get(f"{_TABLE}number-rows-repeated", 1)) if row else 1
                cells += len(row) * times
                check_size(path, 8 * cells)
                rows += [row] * times
                element.clear()
            elif element.tag == f"{_TABLE}table":
                pages.append((element.get(f"{_TABLE}name", "sheet"), rows))
                rows = []
                element.clear()
    return _tables(path, pages)


def _open_row(row: ElementTree.Element) -> list[Cell]:
    cells: list[Cell] = []
    for element in row:
        cell = _open_cell(element)
        # Empty cells are repeated to a page's edge.
        cells += [cell] * min(int(element.get(f"{_TABLE}number-columns-repeated", 1)), _MOST_COLUMNS)
    while cells and cells[-1] is None:
        cells.pop()
    return cells


def _open_cell(element: ElementTree.Element) -> Cell:
    kind = element.get(f"{_OFFICE}value-type")
    if kind in ("float", "percentage", "currency"):
        return float(element.get(f"{_OFFICE}value", "nan"))
    if kind == "date":
        return element.get(f"{_OFFICE}date-value")
    span = _SPAN.fullmatch(element.get(f"{_OFFICE}time-value", "")) if kind == "time" else None
    if span is not None:
        return f"{int(span['h'])}:{int(span['m']):02d}:{float(span['s']):09.6f}"
    return "".join("".join(one.itertext()) for one in element.iter(f"{_TEXT}p")) or None


def _tables(
    path: Path, pages: Iterable[tuple[str, Iterable[Sequence[object]]]], remarks: tuple[str, ...] = ()
) -> list[Sheet]:
    """Return the tables of pages that have one.

    Raises
    ------
    InputError
        If none has, and many cells have something beside their numbers.
    """
    found: list[Sheet] = []
    told: list[tuple[str, str]] = []
    for name, given in pages:
        rows: list[list[Cell]] = [[_cell(value) for value in row] for row in given]
        told_of = remarks
        if mark := _decimal_mark(rows):
            words = "points" if mark == "." else "commas"
            told_of = (*remarks, f"numbers are text with decimal {words}: every number can be read this way")
            rows = [
                [float(c.replace(mark, ".")) if isinstance(c, str) and _NUMBER.fullmatch(c) else c for c in row]
                for row in rows
            ]
        sheet = sheet_of_rows(path, name, rows, told_of)
        if sheet is not None:
            found.append(sheet)
        else:
            told += filter(None, (why_no_number(cell) for row in rows for cell in row if isinstance(cell, str)))
    if not found and len(told) >= FEWEST_ROWS:
        raise InputError(path, "file", *told[0])
    return found


def _cell(value: object) -> Cell:
    """Return a number as a float, a span of time as a clock's."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    if isinstance(value, timedelta):
        minutes, seconds = divmod(value.total_seconds(), 60.0)
        return f"{int(minutes // 60)}:{int(minutes % 60):02d}:{seconds:09.6f}"
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

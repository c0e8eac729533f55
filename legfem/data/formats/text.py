"""Tables in text: CSV of any dialect, and the exports of testing machines.

Layouts: Instron Bluehill's ``Specimen_RawData_1.csv`` (label and value lines, then names, then
units in brackets), MTS TestSuite's (names, then a row of units), Zwick testXpert's (German names, a
row of units, semicolons, decimal commas), Bose WinTest's (quoted, a comma at the end of each line
and a null byte after the first). All are names, perhaps units, and numbers below what else.
"""

import codecs
import csv
import re
from pathlib import Path

from legfem.common.errors import InputError
from legfem.data.formats.sheet import CLOCK, FEWEST_ROWS, THOUSANDS, Cell, Sheet, sheet_of_rows, why_no_number

_DELIMITERS = {"\t": "tabs", ";": "semicolons", ",": "commas", "|": "bars", " ": "spaces"}
_NUMBER = {
    mark: re.compile(rf"\s*[+-]?(\d+{re.escape(mark)}?\d*|{re.escape(mark)}\d+)([eE][+-]?\d+)?\s*") for mark in ".,"
}
_COMMENT = re.compile(r"^\s*[#%]+\s?")
"""Before a line of names, as NumPy and gnuplot write it."""
_QUOTED_THOUSANDS = re.compile(rf'"\s*({THOUSANDS.pattern})\s*"')
_SPACED_THOUSANDS = re.compile(r"(?<=\d)['’\u00a0\u202f](?=\d{3}(?!\d))")
"""As the Swiss and the French write them; a plain space parts them only in a cell of its own."""
_SPACED_CELL = re.compile(r'(?:^|(?<=[;\t"]))\s*[+-]?\d{1,3}(?: \d{3})+(?=(?:[.,]\d*)?\s*(?:[;\t"]|$))')
_QUOTED_LINE = re.compile(r'"[^"]*[,;\t][^"]*"')
_BETWEEN_WORDS = re.compile(r"\s+(?![(\[<])")
"""Not before a unit in brackets."""
_BARE_THOUSANDS = re.compile(r'(?<![\d."])\d{1,3}(,\d{3})+\.\d+(?![\d"])')
_LINES_TRIED = 40


def read_text(path: Path) -> list[Sheet]:
    """Read a text file's table.

    Raises
    ------
    InputError
        If it is no text, or no table of numbers, or one that can be read in two ways.
    """
    text, encoding = _decoded(path)
    given = text.splitlines()
    if all(_QUOTED_LINE.fullmatch(line.strip()) for line in given if line.strip()):
        given = [line.strip().removeprefix('"').removesuffix('"') for line in given]
    lines, grouped = [], 0
    for line in given:
        # In quotes, and with a decimal mark of the other kind, there is but one way to read them.
        plain, count = _QUOTED_THOUSANDS.subn(_without_thousands, _COMMENT.sub("", line))
        plain, further = _SPACED_THOUSANDS.subn("", plain)
        plain, more = _SPACED_CELL.subn(lambda found: found[0].replace(" ", ""), plain)
        lines.append(plain)
        grouped += count + further + more
    _check_thousands(path, lines)
    delimiter, decimal = _dialect(path, lines)
    parted = _parted(lines, delimiter)
    if delimiter == " ":
        # Words of another number than the columns name none of them: one of theirs would be its neighbour's.
        width = len(parted[_middle_of(lines)])
        parted = [row if len(row) == width else [" ".join(row)] for row in parted]
    rows = [[_cell(c, decimal) for c in cells] for cells in parted]
    remarks: tuple[str, ...] = (
        f"text in {encoding}, columns parted by {_DELIMITERS[delimiter]}, decimals by "
        f"{'points' if decimal == '.' else 'commas'}: so the numbers are complete",
    )
    if grouped:
        remarks += (f"{grouped} numbers have thousands' separators, which are taken out",)
    found = sheet_of_rows(path, "", rows, remarks)
    return [] if found is None else [found]


def _without_thousands(found: re.Match[str]) -> str:
    text = found[1]
    return f'"{text.replace("," if text.rfind(".") > text.rfind(",") else ".", "")}"'


def _check_thousands(path: Path, lines: list[str]) -> None:
    """Refuse thousands' separators that part one number into two cells."""
    cells = _parted(lines, ",")
    narrow = min((len(row) for row in cells if len(row) > 1 and _are_numbers(row, ".")), default=0)
    found = [
        (k, one[0])
        for k, line in enumerate(lines)
        if len(cells[k]) > narrow > 0 and _are_numbers(cells[k], ".")
        for one in _BARE_THOUSANDS.finditer(line)
    ]
    if found:
        raise InputError(
            path,
            f"line {found[0][0] + 1}",
            f"'{found[0][1]}' has a thousands' separator without quotes ({len(found)} such numbers)",
            "export numbers without thousands' separators, or in quotes",
        )


def _decoded(path: Path) -> tuple[str, str]:
    raw = path.read_bytes()
    for mark, name in (
        (codecs.BOM_UTF8, "utf-8-sig"),
        (codecs.BOM_UTF16_LE, "utf-16"),
        (codecs.BOM_UTF16_BE, "utf-16"),
    ):
        if raw.startswith(mark):
            return raw.decode(name, errors="replace"), name.removesuffix("-sig")
    if raw.count(0) > 0.002 * len(raw) + 1:
        raise InputError(path, "file", "is no text (it holds null bytes)", "export it as CSV from its program")
    raw = raw.replace(b"\0", b"")
    try:
        return raw.decode("utf-8"), "utf-8"
    except UnicodeDecodeError:
        return raw.decode("cp1252", errors="replace"), "cp1252 (it isn't utf-8)"


def _middle_of(lines: list[str]) -> int:
    filled = [k for k, line in enumerate(lines) if line.strip()]
    return filled[len(filled) // 2]


def _dialect(path: Path, lines: list[str]) -> tuple[str, str]:
    """Return delimiter and decimal mark with which the last lines are numbers throughout."""
    filled = [line for line in lines if line.strip()]
    # The middle, where no heading is, and the end, unless something follows there. A table of few rows has one
    # line above its numbers.
    middle = len(filled) // 2 if len(filled) >= FEWEST_ROWS else 1
    tried = filled[middle : middle + _LINES_TRIED] or filled
    fits = [
        (delimiter, decimal, widths.pop())
        for delimiter in _DELIMITERS
        # Of an empty column between tabs, and of nothing else, spaces would make no cell.
        if delimiter != " " or not all("\t" in line.strip() for line in tried)
        for decimal in ".,"
        if decimal != delimiter or any('"' in line for line in tried)
        if len(widths := _widths(tried, delimiter, decimal)) == 1
    ]
    fits = [fit for fit in fits if fit[2] >= 2] or _with_other_columns(tried)
    if len(filled) < 2 or not fits:
        ragged = any(len(_widths(tried, d, ".")) > 1 for d in "\t;,|")
        cells = [cell for d in "\t;," for row in _parted(tried, d) for cell in row]
        problem, remedy = next(filter(None, map(why_no_number, cells)), None) or (
            "its rows have different numbers of cells"
            if ragged and len(filled) >= FEWEST_ROWS
            else "holds no table of numbers",
            "export it again as CSV with one row a sample",
        )
        raise InputError(path, "file", problem, remedy)
    marked = [fit for fit in fits if any(fit[1] in line for line in tried)] or fits
    best = [fit for fit in marked if fit[0] != " "] or marked
    # Without a point or comma in any number both marks fit alike.
    best = best if len({fit[0] for fit in best}) > 1 else best[:1]
    if len(best) > 1:
        ways = " or ".join(f"{_DELIMITERS[d]} ({w} columns)" for d, _, w in best)
        raise InputError(path, "file", f"its columns may be parted by {ways}", "part them by semicolons or tabs")
    return best[0][0], best[0][1]


def _with_other_columns(lines: list[str]) -> list[tuple[str, str, int]]:
    """Return the dialects in which two columns or more are numbers, of those the ones with most numbers a cell."""
    found: list[tuple[float, tuple[str, str, int]]] = []
    # A sentence's words and years are no columns, unless a clock stands before them.
    clocks = all(any(map(CLOCK.fullmatch, line.split())) for line in lines)
    words = set() if clocks and not all("\t" in line for line in lines) else {" "}
    for delimiter in set(_DELIMITERS) - words:
        rows = _parted(lines, delimiter)
        width = max(map(len, rows))
        for decimal in ".,":
            numbers = [
                sum(k < len(row) and _NUMBER[decimal].fullmatch(row[k]) is not None for row in rows)
                for k in range(width)
            ]
            columns = sum(count == len(rows) for count in numbers)
            if columns >= 2 and (decimal != delimiter or any('"' in line for line in lines)):
                found.append((columns / width, (delimiter, decimal, width)))
    most = max((share for share, _ in found), default=0.0)
    return [fit for share, fit in found if share == most]


def _are_numbers(cells: list[str], decimal: str) -> bool:
    return all(_NUMBER[decimal].fullmatch(cell) for cell in cells)


def _widths(lines: list[str], delimiter: str, decimal: str) -> set[int]:
    """Return the widths of lines of numbers; with 0 where something else is in one."""
    widths = set()
    for cells in _parted(lines, delimiter):
        while cells and not cells[-1].strip():
            cells.pop()
        widths.add(len(cells) if _are_numbers(cells, decimal) else 0)
    return widths


def _parted(lines: list[str], delimiter: str) -> list[list[str]]:
    if delimiter == " ":
        return [line.split() if "(" not in line and "[" not in line else _words(line) for line in lines]
    try:
        return [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=delimiter)]
    except csv.Error:  # a cell of a hundred thousand characters is no number either
        return [[line] for line in lines]


def _words(line: str) -> list[str]:
    """Part a line of names with units in brackets at wide gaps; at all gaps but those before a bracket without any."""
    wide = re.split(r"\s{2,}|\t", line.strip())
    return wide if len(wide) > 1 else _BETWEEN_WORDS.split(line.strip())


def _cell(text: str, decimal: str) -> Cell:
    if _NUMBER[decimal].fullmatch(text):
        return float(text.replace(",", "."))
    return float("nan") if text.lower() in ("nan", "inf", "-inf", "#n/a") else text

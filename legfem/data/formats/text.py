"""Tables in text: CSV of any dialect, and the exports of testing machines.

Layouts: Instron Bluehill's ``Specimen_RawData_1.csv`` (label and value lines, then names, then
units in brackets), MTS TestSuite's (names, then a row of units), Zwick testXpert's (German names, a
row of units, semicolons, decimal commas), Bose WinTest's (quoted, a comma at the end of each line
and a null byte after the first). All are names, perhaps units, and numbers below what else.
"""

import csv
import re
from collections.abc import Sequence
from pathlib import Path

from legfem.common.errors import InputError
from legfem.data.formats.headings import Cell, names_something
from legfem.data.formats.lines import TextLines, read_lines
from legfem.data.formats.sheet import FEWEST_ROWS, THOUSANDS, Sheet, sheet_of_rows, why_no_number
from legfem.data.formats.times import CLOCK

_DELIMITERS = {"\t": "tabs", ";": "semicolons", ",": "commas", "|": "bars", " ": "spaces"}
_NUMBER = {
    mark: re.compile(rf"\s*[+-]?(\d+{re.escape(mark)}?\d*|{re.escape(mark)}\d+)([eEdD][+-]?\d+)?\s*") for mark in ".,"
}
_FORTRAN = str.maketrans(",dD", ".ee")
"""Decimal commas, and exponents as Fortran writes them."""
_WORD = re.compile(r'"([^"]*)"|(\S+)')
_BETWEEN_WORDS = re.compile(r"\s+(?![(\[<])")
"""Not before a unit in brackets."""
_BEHIND_A_BRACKET = re.compile(r"(?<=[)\]>])\s+")
_BARE_THOUSANDS = re.compile(r'(?<![\d."])\d{1,3}(,\d{3})+\.\d+(?![\d"])')
_LINES_TRIED = 40


def read_text(path: Path, part: str | None = None) -> list[Sheet]:
    """Read a text file's table, or that in a part of it.

    Raises
    ------
    InputError
        If it is no text, or no table of numbers, or one that can be read in two ways.
    """
    lines = read_lines(path, part)
    _check_thousands(path, lines.texts)
    delimiter, decimal = _dialect(path, lines)
    parted = _with_row_numbers(lines, _parted(lines.texts, delimiter))
    if delimiter == ",":
        _check_decimals(path, lines, parted)
    if delimiter == " ":
        # Words of another number than the columns name none of them: one of theirs would be its neighbour's.
        width = len(parted[_middle_of(lines.texts)])
        # Where a long name leaves one space of a wide gap, the gaps behind units part names too.
        ways = ((row, [one for word in row for one in _BEHIND_A_BRACKET.split(word)]) for row in parted)
        parted = [next((row for row in both if len(row) == width), [" ".join(both[0])]) for both in ways]
    _check_whole_thousands(path, parted[lines.first :], lines.first, decimal)
    _part_names(lines, parted, delimiter)
    remarks = [
        f"text in {lines.encoding}, columns separated by {_DELIMITERS[delimiter]}, decimal "
        f"{'points' if decimal == '.' else 'commas'}: every number can be read this way",
        *lines.remarks,
    ]
    if not lines.ends and _is_cut(parted, decimal):
        last = next(k for k in reversed(range(len(parted))) if parted[k])
        parted[last] = []
        remarks.append(f"line {last + 1}, the last, breaks off within a number, and is left out")
    rows = [[_cell(c, decimal) for c in cells] for cells in parted]
    found = sheet_of_rows(path, "", rows, tuple(remarks))
    return [] if found is None else [found]


def _with_row_numbers(lines: TextLines, parted: list[list[str]]) -> list[list[str]]:
    """Return rows with a name for the rows' numbers, which R's ``write.table`` and pandas leave without one."""
    samples = [k for k in range(lines.first, len(parted)) if parted[k]]
    head = next((k for k in reversed(range(min(lines.first, len(parted)))) if parted[k]), None)
    if head is None or not samples or len(parted[head]) != len(parted[samples[0]]) - 1:
        return parted
    firsts = [parted[k][0] for k in samples]
    counted = any(firsts == [str(n + first) for n in range(len(firsts))] for first in (0, 1))
    if counted or all(lines.texts[k].startswith(f'"{n}"') for n, k in enumerate(samples, 1)):
        return [["row", *row] if k == head else row for k, row in enumerate(parted)]
    return parted


def _is_cut(rows: Sequence[Sequence[str]], decimal: str) -> bool:
    """Tell whether the last row has fewer decimals in its last cell than all before it, or has no such cell."""
    *before, last = [row for row in rows if row][-_LINES_TRIED:]
    if len(before) < FEWEST_ROWS or not all(_are_numbers(row, decimal) for row in before[1:]):
        return False
    if len(last) < min(map(len, before[1:])) and _are_numbers(last, decimal):
        return True
    digits = {len(row[-1].partition(decimal)[2]) for row in before[1:]}
    begun = last[-1] in ("", "-", "+") or _are_numbers(last[-1:], decimal)
    return begun and len(digits) == 1 and len(last[-1].partition(decimal)[2]) < digits.pop()


def _check_thousands(path: Path, lines: list[str]) -> None:
    """Refuse thousands' separators without quotes, which may part one number into two cells."""
    cells = _parted(lines, ",")
    narrow = min((len(row) for row in cells if len(row) > 1 and _are_numbers(row, ".")), default=0)
    found = [
        (k, one[0])
        for k, line in enumerate(lines)
        if len(cells[k]) > narrow > 0 and _are_numbers(cells[k], ".")
        for one in _BARE_THOUSANDS.finditer(line)
    ]
    found = found or _thousands_in_cells(lines)
    if found:
        problem = f"'{found[0][1]}' has a thousands' separator without quotes ({len(found)} such numbers)"
        remedy = "export numbers without thousands' separators, or in quotes"
        raise InputError(path, f"line {found[0][0] + 1}", problem, remedy)


def _thousands_in_cells(lines: list[str]) -> list[tuple[int, str]]:
    """Return lines and numbers with thousands' separators, of tables parted by semicolons or tabs."""
    found = []
    for k, line in enumerate(lines):
        cells = [cell.strip() for cell in re.split(r"[;\t]", line)]
        grouped = [cell for cell in cells if THOUSANDS.fullmatch(cell)]
        others = [cell for cell in cells if cell and cell not in grouped]
        if len(cells) > 1 and any(_are_numbers(others, mark) for mark in ".,"):
            found += [(k, cell) for cell in grouped]
    return found


_A_WHOLE_THOUSAND = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")
_FEWEST_THOUSANDS = 20


def _check_whole_thousands(path: Path, samples: Sequence[Sequence[str]], first: int, decimal: str) -> None:
    """Refuse a column of thousands: all numbers with a mark have three figures behind it, and others have no mark.

    Decimals would be fewer in some of so many numbers, or as many in all.
    """
    for c in range(max(map(len, samples), default=0)):
        cells = [(k, row[c]) for k, row in enumerate(samples) if c < len(row) and row[c]]
        grouped = [k for k, cell in cells if decimal in cell]
        if not _FEWEST_THOUSANDS <= len(grouped) < len(cells):
            continue
        whole = [cell for _, cell in cells if decimal not in cell]
        grouped_all = all(_A_WHOLE_THOUSAND.fullmatch(samples[k][c]) for k in grouped)
        if grouped_all and all(cell.strip(" +-").isdigit() for cell in whole):
            problem = f"'{samples[grouped[0]][c]}' seems to have a thousands' separator ({len(grouped)} such numbers)"
            remedy = "export numbers without thousands' separators"
            raise InputError(path, f"line {first + grouped[0] + 1}", problem, remedy)


_LINES_OF_NAMES = 4


def _part_names(lines: TextLines, parted: list[list[str]], delimiter: str) -> None:
    """Part names where something else is between them than between the numbers, as Igor writes ``WAVES a, b, c``."""
    middle = parted[_middle_of(lines.texts)]
    before = [""] if middle[0] == "" else []
    above = [k for k in range(min(lines.first, len(parted))) if parted[k]][-_LINES_OF_NAMES:]
    for k in above:
        if delimiter != " " and len(parted[k]) == len(middle):
            continue
        for other in ("\t", ";", ",", "|", None):
            cells = [cell.strip() for cell in lines.texts[k].split(other)]
            named = sum(map(names_something, cells))
            # Spaces are between any words.
            if len(before + cells) == len(middle) and named > (1 if other else len(cells) - 1):
                parted[k] = before + cells
                break


def _check_decimals(path: Path, lines: TextLines, parted: Sequence[Sequence[str]]) -> None:
    """Refuse numbers whose decimal commas part them into two cells each."""
    head = next((k for k in reversed(range(min(lines.first, len(parted)))) if parted[k]), None)
    if head is None or lines.first >= len(parted):
        return
    names, cells = len(parted[head]), len(parted[lines.first])
    if names > 1 and cells == 2 * names and not any("." in cell for cell in parted[lines.first]):
        problem = f"{names} names are above {cells} cells: commas separate both the cells and the decimals"
        remedy = "export it with semicolons or tabs between the cells, or with decimal points"
        raise InputError(path, f"line {lines.first + 1}", problem, remedy)


def _middle_of(lines: list[str]) -> int:
    filled = [k for k, line in enumerate(lines) if line.strip()]
    return filled[len(filled) // 2]


def _dialect(path: Path, lines: TextLines) -> tuple[str, str]:
    """Return delimiter and decimal mark with which the last lines are numbers throughout."""
    filled = [line for line in lines.texts if line.strip()]
    # A page's heading, which is printed anew, is no sample.
    head = set(lines.texts[: lines.first] if lines.first < len(lines.texts) else ())
    # The middle, where no heading is, and the end, unless something follows there. A table of few rows has one
    # line above its numbers.
    count = len(filled)
    # In the middle of several blocks another's heading may stand.
    for begin in (count // 2, count // 4, 3 * count // 4) if count >= FEWEST_ROWS else (1,):
        tried = [line for line in filled[begin:] if line not in head][:_LINES_TRIED] or filled
        fits = _fitting(tried) or _with_other_columns(tried)
        if fits:
            break
    if len(filled) < 2 or not fits:
        raise InputError(path, "file", *_why_no_table(filled, tried))
    marked = [fit for fit in fits if any(fit[1] in line for line in tried)] or fits
    best = [fit for fit in marked if fit[0] != " "] or marked
    # Without a point or comma in any number both marks fit alike.
    best = best if len({fit[0] for fit in best}) > 1 else best[:1]
    if len(best) > 1:
        ways = " or ".join(f"{_DELIMITERS[d]} ({w} columns)" for d, _, w in best)
        raise InputError(path, "file", f"its columns may be separated by {ways}", "separate them by semicolons or tabs")
    return best[0][0], best[0][1]


def _fitting(tried: list[str]) -> list[tuple[str, str, int]]:
    """Return the dialects, and the columns, in which all that lines hold are numbers."""
    fits = [
        (delimiter, decimal, widths.pop())
        for delimiter in _DELIMITERS
        # Of an empty column between tabs, and of nothing else, spaces would make no cell.
        if delimiter != " " or not all("\t" in line.strip() for line in tried)
        for decimal in ".,"
        if decimal != delimiter or any('"' in line for line in tried)
        if len(widths := _widths(tried, delimiter, decimal)) == 1
    ]
    return [fit for fit in fits if fit[2] >= 2]


def _why_no_table(filled: Sequence[str], tried: list[str]) -> tuple[str, str]:
    """Return what keeps lines from being a table of numbers, and how to mend it."""
    cells = [cell for d in "\t;," for row in _parted(tried, d) for cell in row]
    if told := next(filter(None, map(why_no_number, cells)), None):
        return told
    if any(_are_numbers([line], mark) for mark in ".," for line in tried):
        return "contains one column of numbers", "export time, displacement and force as three columns of one file"
    if not any(character.isdigit() for line in filled for character in line):
        return "contains no numbers", "export the recording again: it is not in this file"
    if len(filled) >= FEWEST_ROWS and any(len(_widths(tried, d, ".")) > 1 for d in "\t;,|"):
        return "its rows have different numbers of cells", "export it again as CSV with one row for each sample"
    return "contains no table of numbers", "export it again as CSV with one row for each sample"


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


def _are_numbers(cells: Sequence[str], decimal: str) -> bool:
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
        return [
            [quoted or bare for quoted, bare in _WORD.findall(line)]
            if '"' in line or ("(" not in line and "[" not in line)
            else _words(line)
            for line in lines
        ]
    try:
        rows = [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=delimiter, skipinitialspace=True)]
    except csv.Error:  # a cell of a hundred thousand characters is no number either
        rows = []
    # A quote that nothing closes would take the lines below it for its cell.
    if len(rows) == len(lines):
        return rows
    return [row for line in lines for row in _parted([line], delimiter)] if len(lines) > 1 else [lines]


def _words(line: str) -> list[str]:
    """Part a line of names with units in brackets at wide gaps; at all gaps but those before a bracket without any."""
    wide = re.split(r"\s{2,}|\t", line.strip())
    return wide if len(wide) > 1 else _BETWEEN_WORDS.split(line.strip())


def _cell(text: str, decimal: str) -> Cell:
    if _NUMBER[decimal].fullmatch(text):
        return float(text.translate(_FORTRAN))
    return float("nan") if text.lower() in ("nan", "inf", "-inf", "#n/a") else text

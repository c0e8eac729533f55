"""A table of named columns of numbers with their units, as an instrument's file holds it."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite
from pathlib import Path

import numpy as np

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.data.formats import labels
from legfem.data.formats.headings import Cell, cell_at, names_something, only_block, text_of, titles_and_units, width_of
from legfem.data.formats.refused import refuse_other_kind
from legfem.data.formats.times import BY_RATE, CLOCK, times_by_rate, with_clock

FEWEST_ROWS = 8
MOST_BYTES = 200_000_000
"""An hour of a test at 1 kHz, as text, has half as many."""
_ROWS_TRIED = 40
"""Rows in the middle that tell which columns are numbers."""
_MOSTLY = 0.9
"""Share of these rows in which a column of numbers has one."""
_OF_TEXTS = labels.WORDS | {
    "time": labels.WORDS["time"] + r"|^hora|^heure|^ora\b|uhr|clock|stamp|\bdate\b|datum|fecha|\bdata\b"
}
"""By which columns of text are named: a clock's times, which couldn't be read, stand under further names."""
_PLAIN = re.compile(r"[+-]?\d+(?:\.\d*)?(?:e[+-]?\d+)?")
_MIDNIGHT = re.compile(r"\d{4}-\d\d-\d\d 00:00:00")
THOUSANDS = re.compile(r"[+-]?\d{1,3}((,\d{3})+\.\d*|(\.\d{3})+,\d*)")


_VALUE_WITH_UNIT = re.compile(r"[+-]?\d+([.,]\d+)?\s?(?P<unit>[^\W\d]{1,3})")


@dataclass(frozen=True, eq=False)
class Column:
    """A column as the file gives it.

    Parameters
    ----------
    name : str
        Without the unit.
    unit : str or None
        As it is written; None where none is stated. A force's kg is kgf.
    values : (n,) array
        In that unit.
    """

    name: str
    unit: str | None
    values: FloatArray

    def __post_init__(self) -> None:
        unit = labels.FORCE_OF.get((self.unit or "").strip(" ()[].").lower())
        if unit is not None and labels.names_quantity(self.name, "force"):
            object.__setattr__(self, "unit", unit)

    @property
    def known_unit(self) -> labels.Unit | None:
        """The unit, where it is a known one."""
        return labels.unit_named(self.unit or "")

    @property
    def quantity(self) -> labels.Quantity | None:
        """What the unit measures."""
        return None if self.known_unit is None else self.known_unit.quantity

    @property
    def factor(self) -> float:
        """What a value is multiplied by to be in legfem's unit; 1 where the unit isn't known."""
        return 1.0 if self.known_unit is None else self.known_unit.factor

    @property
    def is_time(self) -> bool:
        """Whether it is a time by its unit or its name."""
        return self.quantity == "time" or labels.names_quantity(self.name, "time")


@dataclass(frozen=True, eq=False)
class Sheet:
    """Columns of one length, of one trial: a sheet, a group, or a whole file."""

    name: str
    columns: tuple[Column, ...]
    remarks: tuple[str, ...] = ()
    """What was found out about the file rather than read in it."""
    sizes: Mapping[str, float] = field(default_factory=dict)
    """A specimen's, as the heading states them, by name: mm, and mm² of an area."""

    def named(self, name: str) -> list[Column]:
        """Return the columns of a name; of a heading with its unit, as ``Load (N)``, where none is called so."""
        called = [c for c in self.columns if c.name == name]
        return called or [c for c in self.columns if (c.name, c.unit) == labels.name_and_unit(name)]


def check_size(path: Path, size: int) -> None:
    """Check how many bytes are to be read.

    Raises
    ------
    InputError
        If they are more than a recording has.
    """
    if size > MOST_BYTES:
        problem = f"contains {size / 1e6:,.0f} MB once unpacked; at most {MOST_BYTES / 1e6:g} MB are read"
        raise InputError(path, "file", problem, "export the test alone, sampled less finely")


def file_of(path: Path) -> Path:
    """Return the file that holds a trial's table, whose path names both, as ``tests.xlsx/Trial 1``; else the path."""
    return path if path.exists() else next((one for one in path.parents if one.is_file()), path)


def trial_of(path: Path) -> str:
    """Return the name of a trial: its file's, or its table's in a file of several."""
    file = file_of(path)
    return path.stem if file == path else path.relative_to(file).as_posix().replace("/", "-")


NAMELESS = "its columns have no names"
"""Remark on a table whose columns are named by their places."""
NOT_CALCULATED = "formulas were never calculated"
"""Remark on what a program wrote, and no spreadsheet has evaluated."""


def sheet_of_rows(
    path: Path, name: str, rows: Sequence[Sequence[Cell]], remarks: tuple[str, ...] = (), clock: int | None = None
) -> Sheet | None:
    """Return the table in rows of cells, numbers as floats; None where there is none.

    What is number in the middle of the table are its columns; others, empty or of text, are passed over. The numbers
    begin at the first of three rows that have all of them (of all that remain in a table of few), and end at the last
    that has one, but for rows of text and figures such as ``Max,12.3``; what stands below is passed over too. Above are
    the columns' names, and perhaps a row of units and what else a program writes there; where nothing is, columns are
    called by their places. Beside a named sheet's table
    other cells may stand. Where no column of numbers is the time one of a clock's times becomes it: ``clock`` is its
    place in a second round.

    Raises
    ------
    InputError
        If names of another number stand above the numbers, or anything but headings between them.
    """
    rows, others = only_block(rows)
    kept = [k for k, row in enumerate(rows) if width_of(row)]
    middle = [rows[k] for k in kept[len(kept) // 2 :][:_ROWS_TRIED]]
    width = max(map(width_of, middle), default=0)
    filled = [sum(isinstance(cell_at(row, k), float) for row in middle) for k in range(width)]
    columns = [k for k, count in enumerate(filled) if count >= _MOSTLY * len(middle)]
    start = _first_of_numbers(rows, kept, columns)
    if start is None:
        return None
    # A sample with a cell that is no number, before three whole ones, is none of the heading's.
    while (before := [k for k in kept if k < start]) and _mostly_numbers(rows[before[-1]], columns):
        start = before[-1]
    end = next(k for k in reversed(kept) if _mostly_numbers(rows[k], columns)) + 1
    where = f"{name}, " if name else ""
    # A page's heading is printed anew on the next.
    heading = {tuple(row) for row in rows[:start] if width_of(row)}
    again = _printed_anew(rows, [k for k in kept if start <= k < end], heading, columns)
    samples = [k for k in kept if start <= k < end and k not in again]
    refuse_other_kind(path, [" ".join(map(text_of, row)) for row in rows[:start]], ["bends"])
    titles, units = titles_and_units(rows[:start], columns)
    named = max(width, width_of(titles or ()))
    try:
        for number in samples:
            row = rows[number]
            # A remark that a few rows have, in a column of its own.
            wide = named if all(isinstance(cell, str) for cell in row[width:named]) else width
            _check_row(path, f"{where}line {number + 1}", row, columns, None if name else wide)
    except InputError:
        if name and len(columns) < width:
            return None  # a report's table, beside the recording's
        _check_abreast(path, [text_of(cell) for cell in titles or ()])
        raise
    values = np.array([[rows[k][c] for c in columns] for k in samples], dtype=np.float64)
    count = values[0, 0] if _counts(values) else None
    if count is not None:
        samples, values, others = samples[1:], values[1:], (*others, f"{count:.0f} is a count of samples")
    nameless = titles is None and not any(names_something(text_of(cell)) for row in rows[:start] for cell in row)
    if nameless:
        titles = [f"column {c + 1}" for c in range(width)]
    problem = ""
    if titles is None:
        problem = f"there is no row with the names of the {len(columns)} columns above the numbers"
    elif width_of(titles) > width and not all(text_of(cell_at(titles, c)) for c in columns):
        unclear = "it isn't clear which belongs to which"
        problem = f"{width_of(titles)} names, the first of them empty, are above {width} columns: {unclear}"
    if titles is None or problem:
        remedy = "write a row of names with units, such as Time (s), above the numbers"
        raise InputError(path, f"{where}line {start + 1}", problem, remedy)
    found = []
    for k, c in enumerate(columns):
        column, unit = labels.name_and_unit(text_of(cell_at(titles, c)))
        unit = "s" if c == clock else labels.one_unit(unit, units[k] if units else None)
        unit = unit or _unit_behind(rows, samples, c)
        found.append(Column(column, unit, values[:, k]))
    found = _scaled(path, rows[:start], found)
    if not any(c.is_time for c in found):
        counted = with_clock(path, rows, range(start, end), width)
        if counted is not None:
            remark = "the time is counted from a clock's times"
            return sheet_of_rows(path, name, counted[0], (*remarks, *others, remark), counted[1])
        rated = times_by_rate(rows[:start], [c.name for c in found], np.column_stack([c.values for c in found]))
        if rated is not None and count is not None and count != len(values):
            problem = f"its heading counts {count:.0f} samples, and {len(values)} follow: their times are not known"
            raise InputError(path, "rows", problem, "export it again, with a column of times")
        if rated is not None:
            found.insert(0, Column("Time", "s", rated[0]))
            others = (*others, f"{BY_RATE} '{rated[1]}'")
    found, once = _each_time_once(found)
    passed = {}
    for c in set(range(width)) - set(columns):
        told_in = [one for row in middle if (one := cell_at(row, c)) not in (None, "")]
        cell = text_of(next((one for one in told_in if isinstance(one, str)), next(iter(told_in), None)))
        if cell:
            passed[text_of(cell_at(titles, c))] = cell
    if any(why_no_number(cell) for cell in passed.values()) or not name:
        _check_passed(path, passed, found)
    below = sum(k >= end for k in kept)
    told = [f"{len(passed)} columns without numbers are passed over: {', '.join(map(repr, passed))}"] if passed else []
    told += [f"{below} lines below the numbers are passed over"] if below else []
    told += [f"headings among the numbers are passed over ({len(again)} lines)"] if again else []
    sizes = labels.sizes_in(rows[:start])
    few = ", ".join(f"{size} {value:g} {'mm²' if size == 'area' else 'mm'}" for size, value in sizes.items())
    told += [f"its heading states the specimen's {few}"] if sizes else []
    told += [*once, NAMELESS] if nameless else once
    return Sheet(name, tuple(found), (*remarks, *others, *told), sizes)


_MOST_DOUBLED = 0.2
"""Largest share of rows whose time another has: more are a clock with too few figures."""
_COUNTS_BEYOND = 5.0
"""Times all readings."""


def _counts(values: FloatArray) -> bool:
    """Tell whether the first row is no sample, but how many each channel has: one whole number, beyond all others."""
    first, rest = values[0], np.abs(values[1:])
    if len(values) < FEWEST_ROWS or first[0] != np.round(first[0]) or (first != first[0]).any():
        return False
    return bool(first[0] == len(rest) or (first[0] > max(FEWEST_ROWS, _COUNTS_BEYOND * rest.max())))


_IN_VOLTS = re.compile(r"\bin volts\b|\bunits/V\b", re.IGNORECASE)


def _scaled(path: Path, above: Sequence[Sequence[Cell]], found: list[Column]) -> list[Column]:
    """Return columns that a heading calls volts in the units of the calibration there, as Aurora's DMC writes it.

    A reading is (volts + offset) scale. Source: V. B. Baliga, S. Senthivasan, *workloopR* (2020), ``rescale_data``.

    Raises
    ------
    InputError
        If the heading has no scales.
    """
    told = next((text for row in above for cell in row if _IN_VOLTS.search(text := text_of(cell))), None)
    if told is None:
        return found
    rows = {text_of(cell_at(row, 0)).partition(" (")[0]: row[1:] for row in above}
    table = [*zip(*(rows.get(key, ()) for key in ("Channel", "Units", "Scale", "Offset")), strict=False)]
    scales = {text_of(name): (text_of(unit), scale, offset) for name, unit, scale, offset in table}
    if not any(labels.unit_named(unit) for unit, _, _ in scales.values()):
        raise InputError(path, "columns", f"are in volts, as the heading says ('{told}')", "export them in mm and N")
    columns = [c for c in found if c.name not in scales]
    for c in found:
        unit, scale, offset = scales.get(c.name, ("", None, None))
        if labels.unit_named(unit) and isinstance(scale, float) and isinstance(offset, float):
            columns.append(Column("command " * c.name.startswith("AO") + c.name, unit, (c.values + offset) * scale))
    return columns


def _check_abreast(path: Path, titles: Sequence[str]) -> None:
    """Refuse trials of different lengths side by side, whose names are the same."""
    count = min(
        max((titles.count(title) for title in titles if labels.names_quantity(title, quantity)), default=0)
        for quantity in ("displacement", "force")
    )
    if count > 1:
        raise InputError(path, "columns", f"{count} trials stand side by side", "save each trial in a file of its own")


def _each_time_once(columns: list[Column]) -> tuple[list[Column], list[str]]:
    """Return columns in which rows of one time are one, and what was done: alike ones, or a few pairs, averaged."""
    time = next((c.values for c in columns if c.is_time), np.arange(len(columns[0].values)))
    starts = np.flatnonzero(np.diff(time, prepend=np.nan) != 0)
    counts, values = np.diff(np.append(starts, len(time))), np.stack([c.values for c in columns])
    low, high = np.minimum.reduceat(values, starts, axis=1), np.maximum.reduceat(values, starts, axis=1)
    unlike = (low < high).any(axis=0)
    few = unlike.sum() <= _MOST_DOUBLED * len(time) and counts[unlike].max(initial=2) == 2
    if len(starts) == len(time) or not few:
        return columns, []
    told = {"rows that repeat the one before, left out": int((counts[~unlike] - 1).sum())}
    told["rows with the time of the one before, averaged with it"] = int(unlike.sum())
    found = [replace(c, values=0.5 * (a + b)) for c, a, b in zip(columns, low, high, strict=True)]
    return found, [f"{what}: {count}" for what, count in told.items() if count]


def _unit_behind(rows: Sequence[Sequence[Cell]], samples: Sequence[int], c: int) -> str | None:
    """Return the unit that a gauge writes into a cell of its own behind each number; None where there is none."""
    cells = {text_of(cell_at(rows[k], c + 1)) for k in samples}
    unit = cells.pop() if len(cells) == 1 else ""
    return unit if labels.unit_named(unit) is not None else None


def why_no_number(cell: str) -> tuple[str, str] | None:
    """Return what keeps a cell from being a number, and how to mend it; None for anything else."""
    grouped, valued = THOUSANDS.fullmatch(cell), _VALUE_WITH_UNIT.fullmatch(cell)
    if _MIDNIGHT.fullmatch(cell):
        return f"'{cell[:10]}' is a date, which a spreadsheet took a number for", "import the text with numbers as text"
    if CLOCK.fullmatch(cell):
        return f"its times are a clock's without seconds ('{cell}')", "export time in seconds since the start"
    if grouped is not None:
        return f"its numbers have thousands' separators ('{grouped[0]}')", "export them without"
    if valued is not None and labels.unit_named(valued["unit"]) is not None:
        return (
            f"its cells contain units beside the numbers ('{cell}')",
            "put each unit into its column's name: Force (N)",
        )
    return None


def _check_passed(path: Path, passed: Mapping[str, str], found: Sequence[Column]) -> None:
    """Check that no quantity is in a column of text alone."""
    for quantity, words in _OF_TEXTS.items():
        texts = [title for title in passed if re.search(words, title, re.IGNORECASE)]
        numbers = [c for c in found if labels.names_quantity(c.name, quantity) or c.quantity == quantity]
        if texts and not numbers:
            cell = passed[texts[0]]
            if _PLAIN.fullmatch(cell):
                problem = "is empty in many rows: it was recorded less often than the others"
                raise InputError(path, f"column '{texts[0]}'", problem, "export all columns at one rate")
            problem, remedy = why_no_number(cell) or (f"contains '{cell[:40]}'", "export it as numbers")
            raise InputError(path, f"column '{texts[0]}'", problem, remedy)


def _first_of_numbers(rows: Sequence[Sequence[Cell]], kept: Sequence[int], columns: Sequence[int]) -> int | None:
    if len(columns) < 2:
        return None
    whole = [all(isinstance(cell_at(rows[k], c), float) for c in columns) for k in kept]
    few = len(kept) < FEWEST_ROWS
    return next((k for i, k in enumerate(kept) if all(whole[i : i + 3]) and (few or i + 3 <= len(kept))), None)


def _mostly_numbers(row: Sequence[Cell], columns: Sequence[int]) -> bool:
    numbers = [isinstance(cell_at(row, c), float) for c in columns]
    return numbers[0] and sum(numbers) > 0.5 * len(columns)


def _printed_anew(
    rows: Sequence[Sequence[Cell]], samples: Sequence[int], heading: set[tuple[Cell, ...]], columns: Sequence[int]
) -> set[int]:
    """Return the lines of headings among the numbers, of which one or more stand above the numbers, too."""
    found: set[int] = set()
    run: list[int] = []
    for k in samples:
        if all(isinstance(cell_at(rows[k], c), float) for c in columns):
            words = (rows[j] for j in run if not any(isinstance(cell_at(rows[j], c), float) for c in columns))
            if any(tuple(row) in heading for row in words):
                found.update(j for j in run if not _mostly_numbers(rows[j], columns))
            run = []
        else:
            run.append(k)
    return found


def _check_row(path: Path, where: str, row: Sequence[Cell], columns: Sequence[int], width: int | None) -> None:
    """Check that a row has its numbers and, in a file without a grid, no more cells than the others."""
    cells = [cell_at(row, c) for c in columns]
    if len(row) == width and all(type(cell) is float and isfinite(cell) for cell in cells):
        return
    strange = next((c for c in cells if not isinstance(c, float)), 0.0)
    if (width is not None and width_of(row) > width) or not all(isinstance(c, float) for c in cells):
        found = f"'{strange[:40]}'" if isinstance(strange, str) and strange else f"{width_of(row)} cells"
        if strange in (None, "") and (width in (None, width_of(row)) or len(row) > columns[-1]):
            found = "an empty cell"
        problem = f"{found} where {len(columns)} numbers are needed"
        told = why_no_number(strange) if isinstance(strange, str) else None
        raise InputError(
            path, where, *(told or (problem, "remove what is not a number, and save each trial in a file of its own"))
        )
    if not np.isfinite(cells).all():  # type: ignore[arg-type]
        raise InputError(path, where, "there is no finite number", "remove the row, or record again")

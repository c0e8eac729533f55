"""A table of named columns of numbers with their units, as an instrument's file holds it."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from legfem.common.errors import InputError
from legfem.common.units import MPA_PER_MMHG, FloatArray

Quantity = Literal["time", "displacement", "force", "pressure"]


class Unit(NamedTuple):
    """A unit as a multiple of legfem's own: s, mm, N, MPa; others measure something else."""

    quantity: Quantity | None
    factor: float


_G = 9.80665
_UNITS = {
    "time": {
        1.0: "s sec secs second seconds sek sekunde sekunden seconde secondes segundos secondi с сек 秒",
        1e-3: "ms msec millisecond milliseconds millisekunden мс",
        1e-6: "us µs microsecond microseconds",
        60.0: "min mins minute minutes minuten мин",
        3600.0: "h hr hrs hour hours",
        86400.0: "day days",
    },
    "displacement": {
        1.0: "mm millimeter millimeters millimetre millimetres мм 毫米",
        10.0: "cm centimeter centimeters centimetre centimetres см",
        1000.0: "m meter meters metre metres",
        1e-3: "um µm micron microns micrometer micrometers micrometre micrometres",
        1e-6: "nm nanometer nanometers nanometre nanometres",
        25.4: "in inch inches",
    },
    "force": {
        1.0: "n newton newtons н",
        10.0: "dan",
        1e-2: "cn",
        1e-3: "mn millinewton millinewtons",
        1e-6: "µn un",
        1e-9: "nn",
        1e3: "kn kilonewton kilonewtons кн",
        _G: "kgf kp",
        1e-3 * _G: "gf p",
        4.4482216152605: "lbf",
    },
    "pressure": {
        1.0: "mpa",
        1e-3: "kpa",
        1e-4: "mbar hpa",
        0.1: "bar",
        1e-6: "pa pascal pascals",
        MPA_PER_MMHG: "mmhg torr",
        6.894757293168e-3: "psi",
    },
}
_OTHERS = """
% - v volt volts mv a ma c °c degc k hz deg ° rad mm/s mm/min m/s n/mm kn/mm gpa mm/mm
n.m n·m n*m kn·mm kn.mm n·mm n.mm µm/s um/s nm/s n/mm² n/mm2 cycles cycle g kg lb strain
m/s² m/s^2 m/s2 count counts adc raw lsb bit bits digit digits inc increments steps pulses %fs
"""
_KNOWN = {
    name: Unit(quantity, factor)  # type: ignore[arg-type]
    for quantity, factors in _UNITS.items()
    for factor, names in factors.items()
    for name in names.split()
} | {name: Unit(None, 1.0) for name in _OTHERS.split()}
OWN: dict[Quantity, str] = {"time": "s", "displacement": "mm", "force": "N", "pressure": "kPa"}
"""legfem's unit of each quantity."""


_FORCE_OF = {"g": "gf", "gram": "gf", "grams": "gf", "kg": "kgf", "lb": "lbf", "lbs": "lbf"}
"""What a scale's unit of mass means where a force is measured in it."""
_WRONG_MICRO = re.compile(r"^(?:Â[µμ]|æ)(?=[mNs]$)")
"""Of UTF-8 read as cp1252, and of cp437."""


def unit_named(name: str) -> Unit | None:
    """Return a unit by its name; None for one that isn't known.

    Capitals count in mN and MN, nm and Nm: nobody measures soft tissue in meganewtons, so that
    isn't known, and a newton metre is no length. A micro sign that was decoded by another code page is one.
    """
    # As in ``seconds since 2024-05-03``, of NetCDF.
    plain = name.partition(" since ")[0].strip(" ()[]<>").removeprefix("in ").rstrip(".").replace("μ", "µ")
    plain = _WRONG_MICRO.sub("µ", plain)
    if plain in ("Nm", "NM"):
        return Unit(None, 1.0)
    return None if plain == "MN" else _KNOWN.get(plain.lower())


FEWEST_ROWS = 8
MOST_BYTES = 200_000_000
"""An hour of a test at 1 kHz, as text, has half as many."""
_ROWS_TRIED, _MOSTLY = 40, 0.9
"""Rows in the middle that tell which columns are numbers, and the share of them that is."""
WORDS: dict[Quantity, str] = {
    "time": r"time|zeit|temps|tiempo|tempo|^t$|x_value|tijd|^tid$|время|時間|时间",
    "displacement": r"disp|extension|position|crosshead|travers|weg|stroke|travel|indentation|depth|distance"
    r"|déplacement|deplacement|verschiebung|spostamento|desplazamiento|deslocamento|verplaatsing|förskjutning"
    r"|перемещение|変位|位移|^d$|^z$",
    "force": r"force|load|kraft|(?<![ep])last|fuerza|forza|força|effort|kracht|сила|нагрузка|荷重|^力$|^f[xyz]?$",
}
"""By which columns are named."""
_OF_TEXTS = WORDS | {"time": WORDS["time"] + r"|^hora|^heure|^ora\b|uhr|clock|stamp|\bdate\b|datum|fecha|\bdata\b"}
"""By which columns of text are named: a clock's times, which couldn't be read, stand under further names."""
CLOCK = re.compile(
    r"(?:[^:]*[T\s])?(?P<h>\d{1,3}):(?P<m>\d\d)(?::(?P<s>\d\d))?(?:[.,:](?P<part>\d+))?"
    r"\s*(?:(?P<half>[ap])\.?\s?m\.?)?(?:Z|\s?[+-]\d\d:?\d\d)?",
    re.IGNORECASE,
)
"""A time of day with perhaps a date before it."""
_MIDNIGHT = re.compile(r"\d{4}-\d\d-\d\d 00:00:00")
_DAY_S = 86400.0
THOUSANDS = re.compile(r"[+-]?\d{1,3}((,\d{3})+\.\d*|(\.\d{3})+,\d*)")

type Cell = str | float | None

_VALUE_WITH_UNIT = re.compile(r"[+-]?\d+([.,]\d+)?\s?(?P<unit>[^\W\d]{1,3})")
_IN_BRACKETS = re.compile(r"^(?P<name>.*?)\s*[(\[<{]\s*(?P<unit>[^)\]>}]*?)\s*[)\]>}]\s*$")
_AT_THE_END = re.compile(r"^(?P<name>.+?)(?:_|[,;:]\s*|\s*/\s*|\s+-\s+|\s+in\s+|\s+)(?P<unit>[^\W\d_]+\.?)$")

_BY_R = re.compile(r"^(?P<name>.+?)\.\.(?P<unit>[^\W\d_]+)\.$")
"""``Load..N.``: R writes points for all that can't be in its names."""


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
        unit = _FORCE_OF.get((self.unit or "").strip(" ()[]").lower())
        if unit is not None and names_quantity(self.name, "force"):
            object.__setattr__(self, "unit", unit)


@dataclass(frozen=True, eq=False)
class Sheet:
    """Columns of one length, of one trial: a sheet, a group, or a whole file."""

    name: str
    columns: tuple[Column, ...]
    remarks: tuple[str, ...] = ()
    """What was found out about the file rather than read in it."""


def check_size(path: Path, size: int) -> None:
    """Check how many bytes are to be read.

    Raises
    ------
    InputError
        If they are more than a recording has.
    """
    if size > MOST_BYTES:
        raise InputError(
            path,
            "file",
            f"holds {size / 1e6:,.0f} MB once unpacked; at most {MOST_BYTES / 1e6:g} MB are read",
            "export the test alone, sampled less finely",
        )


def name_and_unit(label: str) -> tuple[str, str | None]:
    """Part a column's label, such as ``Load (N)``, ``Kraft [N]`` or ``force_N``."""
    label = " ".join(label.split())
    label = label[1:-1].strip() if len(label) > 2 and label[0] == label[-1] == "'" else label
    bracketed = _IN_BRACKETS.match(label)
    before = _IN_BRACKETS.match(bracketed["name"]) if bracketed else None
    if bracketed and before and unit_named(bracketed["unit"]) is None and unit_named(before["unit"]):
        return f"{before['name']} ({bracketed['unit']})", before["unit"]
    if bracketed:
        return bracketed["name"].rstrip(" ,;:"), bracketed["unit"].removeprefix("in ") or None
    ended = _AT_THE_END.match(label) or _BY_R.match(label)
    if ended and unit_named(ended["unit"]) is not None:
        return ended["name"], ended["unit"]
    return label, None


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
    kept = [k for k, row in enumerate(rows) if _width(row)]
    middle = [rows[k] for k in kept[len(kept) // 2 :][:_ROWS_TRIED]]
    width = max(map(_width, middle), default=0)
    filled = [sum(isinstance(_at(row, k), float) for row in middle) for k in range(width)]
    columns = [k for k, count in enumerate(filled) if count >= _MOSTLY * len(middle)]
    start = _first_of_numbers(rows, kept, columns)
    if start is None:
        return None
    # A sample with a cell that is no number, before three whole ones, is none of the heading's.
    while (before := [k for k in kept if k < start]) and _mostly_numbers(rows[before[-1]], columns):
        start = before[-1]
    end = next(k for k in reversed(kept) if _is_sample(rows[k], columns)) + 1
    where = f"{name}, " if name else ""
    # A page's heading is printed anew on the next.
    heading = [tuple(row) for row in rows[:start] if _width(row)]
    again = {k for k in kept if start <= k < end and tuple(rows[k]) in heading and not _has_numbers(rows[k], columns)}
    samples = [k for k in kept if start <= k < end and k not in again]
    try:
        for number in samples:
            _check_row(path, f"{where}line {number + 1}", rows[number], columns, None if name else width)
    except InputError:
        if name and len(columns) < width:
            return None  # a report's table, beside the recording's
        raise
    values = np.array([[rows[k][c] for c in columns] for k in samples], dtype=np.float64)
    titles, units = _titles(rows[:start], columns)
    nameless = titles is None and not any(_names_something(_text(cell)) for row in rows[:start] for cell in row)
    if nameless:
        titles = [f"column {c + 1}" for c in range(width)]
    if titles is None:
        raise InputError(
            path,
            f"{where}line {start + 1}",
            f"no row with the names of {len(columns)} columns stands above the numbers",
            "give each column a name with its unit, such as Time (s)",
        )
    if _width(titles) > width and not all(_text(_at(titles, c)) for c in columns):
        raise InputError(
            path,
            f"{where}line {start + 1}",
            f"{_width(titles)} names, the first of them empty, stand above {width} columns: which is whose isn't clear",
            "give each column a name with its unit, such as Time (s)",
        )
    found = []
    for k, c in enumerate(columns):
        column, unit = name_and_unit(_text(_at(titles, c)))
        unit = "s" if c == clock else units[k] if units else unit
        found.append(Column(column, unit, values[:, k]))
    if not any(measures(c, "time") or names_quantity(c.name, "time") for c in found):
        counted = _with_clock(rows, range(start, end), width)
        if counted is not None:
            remark = "the time is counted from a clock's times"
            return sheet_of_rows(path, name, counted[0], (*remarks, remark), counted[1])
    passed = {}
    for c in set(range(width)) - set(columns):
        cell = next((one for row in middle if (one := _text(_at(row, c)))), "")
        if cell:
            passed[_text(_at(titles, c))] = cell
    if not name:
        _check_passed(path, passed, found)
    below = sum(k >= end for k in kept)
    told = [f"{len(passed)} columns without numbers are passed over: {', '.join(map(repr, passed))}"] if passed else []
    told += [f"{below} lines below the numbers are passed over"] if below else []
    told += [f"headings among the numbers are passed over ({len(again)} lines)"] if again else []
    told += [NAMELESS] if nameless else []
    return Sheet(name, tuple(found), (*remarks, *told))


def why_no_number(cell: str) -> tuple[str, str] | None:
    """Return what keeps a cell from being a number, and how to mend it; None for anything else."""
    grouped, valued = THOUSANDS.fullmatch(cell), _VALUE_WITH_UNIT.fullmatch(cell)
    if _MIDNIGHT.fullmatch(cell):
        return f"'{cell[:10]}' is a date, which a spreadsheet took a number for", "import the text with numbers as text"
    if CLOCK.fullmatch(cell):
        return f"its times are a clock's without seconds ('{cell}')", "export time in seconds since the start"
    if grouped is not None:
        return f"its numbers have thousands' separators ('{grouped[0]}')", "export them without"
    if valued is not None and unit_named(valued["unit"]) is not None:
        return f"its cells hold units beside the numbers ('{cell}')", "put each unit into its column's name: Force (N)"
    return None


def _with_clock(
    rows: Sequence[Sequence[Cell]], samples: range, width: int
) -> tuple[Sequence[Sequence[Cell]], int] | None:
    """Return rows whose one column of a clock's times is in seconds since the first, and its place; None without."""
    for c in range(width):
        cells = [(k, _at(rows[k], c)) for k in samples]
        times = [(k, _seconds_of(cell)) for k, cell in cells if cell not in (None, "")]
        if not times or any(time is None for _, time in times):
            continue
        read = np.array([time for _, time in times], dtype=np.float64)
        # After midnight a clock begins anew.
        days = np.cumsum(np.diff(read, prepend=read[0]) < -_DAY_S / 2)
        seconds = dict(zip((k for k, _ in times), (read + days * _DAY_S - read[0]).tolist(), strict=True))
        return [[*row[:c], seconds[k], *row[c + 1 :]] if k in seconds else row for k, row in enumerate(rows)], c
    return None


def _seconds_of(cell: Cell) -> float | None:
    """Return the seconds since midnight that a clock shows; None where it is no clock, or ``12:30`` may be minutes."""
    found = CLOCK.fullmatch(cell.strip()) if isinstance(cell, str) else None
    if found is None or (found["s"] is None and found["part"] is None):
        return None
    hours, minutes = int(found["h"]), int(found["m"])
    part = float(f"0.{found['part'] or 0}")
    if found["s"] is None:
        return 60.0 * hours + minutes + part
    if found["half"]:
        hours = hours % 12 + 12 * (found["half"].lower() == "p")
    return 3600.0 * hours + 60.0 * minutes + int(found["s"]) + part


def names_quantity(label: str, quantity: Quantity) -> bool:
    """Tell whether a column is called like a quantity."""
    return re.search(WORDS[quantity], label, re.IGNORECASE) is not None


def _check_passed(path: Path, passed: Mapping[str, str], found: Sequence[Column]) -> None:
    """Check that no quantity is in a column of text alone."""
    for quantity, words in _OF_TEXTS.items():
        texts = [title for title in passed if re.search(words, title, re.IGNORECASE)]
        numbers = [c for c in found if names_quantity(c.name, quantity) or measures(c, quantity)]
        if texts and not numbers:
            cell = passed[texts[0]]
            problem, remedy = why_no_number(cell) or (f"holds '{cell[:40]}'", "export it as numbers")
            raise InputError(path, f"column '{texts[0]}'", problem, remedy)


def measured_by(column: Column) -> Quantity | None:
    """Return the quantity that a column's unit measures."""
    unit = unit_named(column.unit) if column.unit else None
    return None if unit is None else unit.quantity


def measures(column: Column, quantity: Quantity) -> bool:
    """Tell whether a column's unit is one of a quantity."""
    unit = unit_named(column.unit) if column.unit else None
    return unit is not None and unit.quantity == quantity


def _first_of_numbers(rows: Sequence[Sequence[Cell]], kept: Sequence[int], columns: Sequence[int]) -> int | None:
    if len(columns) < 2:
        return None
    whole = [all(isinstance(_at(rows[k], c), float) for c in columns) for k in kept]
    few = len(kept) < FEWEST_ROWS
    return next((k for i, k in enumerate(kept) if all(whole[i : i + 3]) and (few or i + 3 <= len(kept))), None)


def _mostly_numbers(row: Sequence[Cell], columns: Sequence[int]) -> bool:
    numbers = [isinstance(_at(row, c), float) for c in columns]
    return numbers[0] and sum(numbers) > 0.5 * len(columns)


def _has_numbers(row: Sequence[Cell], columns: Sequence[int]) -> bool:
    return any(isinstance(_at(row, c), float) for c in columns)


def _is_sample(row: Sequence[Cell], columns: Sequence[int]) -> bool:
    """Tell whether a row has a number and no text in its first column, as ``Max`` stands below a table."""
    first = _at(row, columns[0])
    return _has_numbers(row, columns) and not (isinstance(first, str) and first[:1].isalpha())


def _at(row: Sequence[Cell], k: int) -> Cell:
    return row[k] if k < len(row) else None


def _check_row(path: Path, where: str, row: Sequence[Cell], columns: Sequence[int], width: int | None) -> None:
    """Check that a row has its numbers and, in a file without a grid, no more cells than the others."""
    cells = [_at(row, c) for c in columns]
    strange = next((c for c in cells if not isinstance(c, float)), None)
    if (width is not None and _width(row) > width) or not all(isinstance(c, float) for c in cells):
        found = f"'{str(strange)[:40]}'" if strange not in (None, "") else f"{_width(row)} cells"
        if strange in (None, "") and width in (None, _width(row)):
            found = "an empty cell"
        problem = f"{found} where {len(columns)} numbers are needed"
        told = why_no_number(strange) if isinstance(strange, str) else None
        raise InputError(path, where, *(told or (problem, "keep one trial a file, and take out what is no number")))
    if not np.isfinite(cells).all():  # type: ignore[arg-type]
        raise InputError(path, where, "a number isn't finite", "take the row out, or record again")


def _text(cell: Cell) -> str:
    return str(cell or "").strip()


def _titles(
    above: Sequence[Sequence[Cell]], columns: Sequence[int]
) -> tuple[Sequence[Cell] | None, list[str | None] | None]:
    """Return the row of names and, where they have a row of their own, the columns' units.

    Of several rows that are wide enough the names are the one most of whose cells name a quantity or a unit.
    """
    above = [_paired(row, len(columns)) for row in above]
    rows = [
        row for row in above if _width(row) > columns[-1] and not all(isinstance(_at(row, c), float) for c in columns)
    ]
    if not rows:
        return None, None
    full = [[_text(_at(row, c)) for c in columns] for row in rows]
    units = next((k for k in reversed(range(len(full))) if _are_units(full[k])), None)
    # Above the units, or below where nothing stands above; a row of units alone names the columns too.
    first, last = (0, units or len(full)) if units != 0 else (min(1, len(full) - 1), len(full))
    scores = [sum(map(_names_something, cells)) for cells in full[first:last]]
    named = last - 1 - int(np.argmax(scores[::-1]))
    own = None if units is None else [text.strip("()[]<> ") or None for text in full[units]]
    return rows[named], own


def _paired(row: Sequence[Cell], count: int) -> Sequence[Cell]:
    """Return a row of names each followed by its unit, as ``Time;s;Force;N`` above two columns, as a row of labels."""
    units = [_text(cell) for cell in row[1::2]]
    if len(units) != count or _width(row) != 2 * count or not all(map(unit_named, units)):
        return row
    return [f"{_text(name)} ({unit})" for name, unit in zip(row[::2], units, strict=True)]


def _are_units(cells: Sequence[str]) -> bool:
    """Tell whether a row holds units: most of what it holds are known."""
    bare = [text.strip("()[]<> ") for text in cells if text]
    return sum(unit_named(text) is not None for text in bare) > 0.5 * len(bare)


def _names_something(label: str) -> bool:
    name, unit = name_and_unit(label)
    if unit is not None and name and unit_named(unit) is not None:
        return True
    return any(re.search(words, label, re.IGNORECASE) for words in WORDS.values())


def _width(row: Sequence[Cell]) -> int:
    """Return the number of cells without empty ones at the end."""
    filled = [k for k, cell in enumerate(row) if cell not in (None, "")]
    return filled[-1] + 1 if filled else 0

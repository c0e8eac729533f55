"""A table of named columns of numbers with their units, as an instrument's file holds it."""

from __future__ import annotations

import re
from collections.abc import Sequence
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
        1.0: "s sec secs second seconds sek sekunde sekunden seconde secondes",
        1e-3: "ms msec",
        1e-6: "us µs",
        60.0: "min minute minutes minuten",
        3600.0: "h hr hour",
    },
    "displacement": {
        1.0: "mm millimeter millimeters millimetre",
        10.0: "cm",
        1000.0: "m meter metre",
        1e-3: "um µm micron microns",
        25.4: "in inch inches",
    },
    "force": {1.0: "n newton newtons", 1e-3: "mn", 1e3: "kn", _G: "kgf kp", 1e-3 * _G: "gf p", 4.4482216152605: "lbf"},
    "pressure": {
        1.0: "mpa",
        1e-3: "kpa",
        1e-4: "mbar hpa",
        0.1: "bar",
        1e-6: "pa",
        MPA_PER_MMHG: "mmhg torr",
        6.894757293168e-3: "psi",
    },
}
_OTHERS = """
% - v mv a ma c °c degc k hz deg ° rad mm/s mm/min m/s n/mm kn/mm gpa mm/mm nm
n.m n·m n/mm² n/mm2 cycles cycle count g kg lb strain
"""
_KNOWN = {
    name: Unit(quantity, factor)  # type: ignore[arg-type]
    for quantity, factors in _UNITS.items()
    for factor, names in factors.items()
    for name in names.split()
} | {name: Unit(None, 1.0) for name in _OTHERS.split()}
OWN: dict[Quantity, str] = {"time": "s", "displacement": "mm", "force": "N", "pressure": "kPa"}
"""legfem's unit of each quantity."""


def unit_named(name: str) -> Unit | None:
    """Return a unit by its name; None for one that isn't known.

    Capitals count in mN and MN only: nobody measures soft tissue in meganewtons, so the latter
    isn't known.
    """
    plain = name.strip().replace("μ", "µ")
    return None if plain == "MN" else _KNOWN.get(plain.lower())


FEWEST_ROWS = 8

type Cell = str | float | None

_IN_BRACKETS = re.compile(r"^(?P<name>.*?)\s*[(\[<{]\s*(?P<unit>[^)\]>}]*?)\s*[)\]>}]\s*$")
_AT_THE_END = re.compile(r"^(?P<name>.+?)(?:_|,\s*|\s*/\s*|\s+in\s+|\s+)(?P<unit>[^\W\d]+)$")


@dataclass(frozen=True, eq=False)
class Column:
    """A column as the file gives it.

    Parameters
    ----------
    name : str
        Without the unit.
    unit : str or None
        As it is written; None where none is stated.
    values : (n,) array
        In that unit.
    """

    name: str
    unit: str | None
    values: FloatArray


@dataclass(frozen=True, eq=False)
class Sheet:
    """Columns of one length, of one trial: a sheet, a group, or a whole file."""

    name: str
    columns: tuple[Column, ...]
    remarks: tuple[str, ...] = ()
    """What was found out about the file rather than read in it."""


def name_and_unit(label: str) -> tuple[str, str | None]:
    """Part a column's label, such as ``Load (N)``, ``Kraft [N]`` or ``force_N``."""
    label = " ".join(label.split())
    bracketed = _IN_BRACKETS.match(label)
    if bracketed:
        return bracketed["name"], bracketed["unit"] or None
    ended = _AT_THE_END.match(label)
    if ended and unit_named(ended["unit"]) is not None:
        return ended["name"], ended["unit"]
    return label, None


def sheet_of_rows(path: Path, name: str, rows: Sequence[Sequence[Cell]], remarks: tuple[str, ...] = ()) -> Sheet | None:
    """Return the table in rows of cells, numbers as floats; None where there is none.

    The numbers begin at the first of three rows of numbers of one width; above them stand the
    columns' names, and between the two may stand a row of units. Nothing but numbers may follow.

    Raises
    ------
    InputError
        If there are no names above the numbers, or anything else between or after the numbers.
    """
    start = _first_of_numbers(rows)
    if start is None:
        return None
    width = _width(rows[start])
    where = f"{name}, " if name else ""
    for number, row in enumerate(rows[start:], start + 1):
        _check_row(path, f"{where}line {number}", row, width)
    numbers = [row[:width] for row in rows[start:] if _width(row)]
    labels, units = _labels(rows[:start], width)
    if labels is None:
        raise InputError(
            path,
            f"{where}line {start + 1}",
            f"no row with the names of {width} columns stands above the numbers",
            "give each column a name with its unit, such as Time (s)",
        )
    values = np.array(numbers, dtype=np.float64)
    columns = []
    for k, label in enumerate(labels):
        column, unit = name_and_unit(label)
        columns.append(Column(column, units[k] if units else unit, values[:, k]))
    return Sheet(name, tuple(columns), remarks)


def _first_of_numbers(rows: Sequence[Sequence[Cell]]) -> int | None:
    kept = [k for k, row in enumerate(rows) if _width(row)]
    for a, b, c in zip(kept, kept[1:], kept[2:], strict=False):
        widths = {_width(rows[k]) for k in (a, b, c)}
        if len(widths) == 1 and widths.pop() >= 2 and all(_all_numbers(rows[k]) for k in (a, b, c)):
            return a
    return None


def _check_row(path: Path, where: str, row: Sequence[Cell], width: int) -> None:
    if _width(row) == 0:
        return
    strange = next((c for c in row[: _width(row)] if not isinstance(c, float)), None)
    if _width(row) != width or strange is not None:
        found = f"'{str(strange)[:40]}'" if strange not in (None, "") else f"{_width(row)} cells"
        if strange in (None, "") and _width(row) == width:
            found = "an empty cell"
        raise InputError(
            path,
            where,
            f"{found} where {width} numbers are needed",
            "keep one trial a file, and take out what is no number",
        )
    if not np.isfinite(row[:width]).all():  # type: ignore[arg-type]
        raise InputError(path, where, "a number isn't finite", "take the row out, or record again")


def _labels(above: Sequence[Sequence[Cell]], width: int) -> tuple[list[str] | None, list[str | None] | None]:
    """Return names and, where they have a row of their own, units."""
    full = [row for row in above if _width(row) == width and not _all_numbers(row)]
    if not full:
        return None, None
    last = [str(cell or "").strip() for cell in full[-1][:width]]
    bare = [text.strip("()[]<> ") for text in last]
    if len(full) > 1 and any(bare) and all(not t or unit_named(t) is not None for t in bare):
        names = [str(cell or "").strip() for cell in full[-2][:width]]
        return names, [text or None for text in bare]
    return last, None


def _width(row: Sequence[Cell]) -> int:
    """Return the number of cells without empty ones at the end."""
    filled = [k for k, cell in enumerate(row) if cell not in (None, "")]
    return filled[-1] + 1 if filled else 0


def _all_numbers(row: Sequence[Cell]) -> bool:
    return all(isinstance(cell, float) for cell in row[: _width(row)])

"""Tables of stretch and stress without a time, as papers publish tests of rubber, brain, foam and clots.

Such a table is a test's result: what was pulled or pressed is a body of any size, loaded so slowly that time doesn't
count.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np

from legfem.common.errors import InputError
from legfem.common.input_files import FileTable, Text, Trouble, unless_one_of
from legfem.common.units import FloatArray
from legfem.data.formats import Column, Sheet, read_sheets
from legfem.data.formats.labels import UNIT_OF, unit_named

_STRETCH = r"stretch|lambda|^λ|élongation"
_STRAIN = r"strain|dehnung|^eps(ilon)?|^ε|shear|^gamma|^γ"
_STRESS = r"stress|spannung|sigma|^σ|contrainte|^p$|^p1?1$|^tau$|^τ"
_NOMINAL, _TRUE = r"nominal|engineering|piola|pk1|^p$|^p1?1$", r"true|cauchy|sigma|^σ"
_ORDER = 3
"""Order of the divided differences that noise is seen by: a curve of loading is a parabola over four neighbours."""
_LEAST_ROWS = 6
_PERCENT = ("%", "percent", "pct", "prozent")
_MOST_STRAIN = 15.0
"""Of the softest rubber: what goes farther is in percent."""


class StressTableEntry(FileTable):
    """``table`` in ``[recordings]``: files are tables of stretch and stress without a time."""

    stretch: Text | None = None
    """Column of the stretch: length over undeformed length."""
    strain: Text | None = None
    """Column of the strain (stretch less one, or the amount of shear), in place of the stretch."""
    percent: bool = False
    """Whether the strain is in percent."""
    stress: Text
    """Column of the stress, or of the force."""
    unit: Text
    """Unit of the stress, or of a force on the area that is stated with the test."""
    measure: Literal["nominal", "true"] | None = None
    """Nominal (engineering) stress is the force over the undeformed area; in simple shear both are alike."""
    sheet: Text | None = None
    """Name of the table or sheet in files that have several."""

    @property
    def of_force(self) -> bool:
        """Whether the load is a force."""
        unit = unit_named(self.unit)
        return unit is not None and unit.quantity == "force"

    def troubles(self) -> Iterator[Trouble]:
        """Yield neither stretch nor strain, or both."""
        yield from unless_one_of(self, "stretch", "strain", "give the column of one of them")


def stretch_and_stress(sheet: Sheet, timed: bool = False) -> tuple[Column, Column] | None:
    """Return the columns of a table of stretch (or strain) and stress with or without a time; None for any other.

    Without a time a force may be in the stress' place.
    """
    stretch = [
        c
        for c in sheet.columns
        if (re.search(f"{_STRETCH}|{_STRAIN}", c.name, re.IGNORECASE) or (c.name, c.unit) == ("x", "%"))
        and not c.quantity
        and not re.search("stress", c.name, re.IGNORECASE)
    ]
    stress = [
        c
        for c in sheet.columns
        if c.quantity == "pressure" or (re.search(_STRESS, c.name, re.IGNORECASE) and not c.quantity)
    ]
    stress = [c for c in stress if c not in stretch] or [
        c for c in sheet.columns if c.quantity == "force" and not timed
    ]
    has_time = any(c.is_time for c in sheet.columns)
    return (stretch[0], stress[0]) if stretch and stress and has_time == timed else None


def table_line(stretch: Column, stress: Column) -> tuple[str, str]:
    """Return what has to be confirmed of a table's columns, and the line of TOML that then reads it."""
    stretched = re.search(_STRETCH, stretch.name, re.IGNORECASE) is not None
    key = "stretch" if stretched else "strain"
    by_size = not stretch.unit and float(np.abs(stretch.values).max()) > _MOST_STRAIN
    percent = not stretched and ((stretch.unit or "").lower() in _PERCENT or by_size)
    is_true = re.search(_TRUE, stress.name, re.IGNORECASE) and not re.search(_NOMINAL, stress.name, re.IGNORECASE)
    measure = "true" if is_true else "nominal"
    forced = stress.quantity == "force"
    unit = stress.unit if stress.unit and (forced or stress.quantity == "pressure") else UNIT_OF["pressure"]
    words = {"nominal": "engineering stress, force over the undeformed area", "true": "true stress"}
    load = "the force on the area_mm2 that you state" if forced else words[measure]
    of = " in %" if percent else ""
    confirm = f"if '{stretch.name}' is a {key}{of} and '{stress.name}' {load} in {unit}"
    parts = [f'{key} = "{stretch.name}"', *(["percent = true"] if percent else [])]
    parts += [f'stress = "{stress.name}"', f'unit = "{unit}"', *([] if forced else [f'measure = "{measure}"'])]
    return confirm, f"table = {{ {', '.join(parts)} }}"


def refuse_untimed(path: Path, sheet: Sheet) -> InputError:
    """Return the refusal of a table where a recording is asked for, with what would read it."""
    stretch, stress = stretch_and_stress(sheet) or sheet.columns[:2]
    unit = f" in {stress.unit}" if stress.unit else ""
    confirm, line = table_line(stretch, stress)
    forces = [f"'{c.name}'" for c in sheet.columns if c.quantity == "force"] if stress.quantity == "force" else []
    load, names = ("force", " or ".join(forces)) if forces else ("stress", f"'{stress.name}'")
    problem = f"is a table of stretch and {load} ('{stretch.name}' and {names}{unit}) without a time"
    return InputError(path, "columns", problem, f"{confirm}, give in specimen.toml, in the table [recordings]: {line}")


def read_stress_table(path: Path, columns: StressTableEntry, area: float) -> tuple[FloatArray, FloatArray]:
    """Read strain (n,) and stress (n,), MPa, which is a force over an area (mm²) where the table has that.

    Raises
    ------
    InputError
        If a column or unit isn't there, a stretch isn't above zero, or there are too few rows.
    """
    sheets = read_sheets(path)
    named = [one for one in sheets if columns.sheet is None or one.name == columns.sheet]
    if len(named) != 1:
        names = ", ".join(f"'{one.name}'" for one in sheets)
        raise InputError(path, "recordings.table.sheet", f"names {len(named)} of the tables {names}", "name one")
    strain, stress = (
        _column(path, named[0], name) for name in (columns.stretch or columns.strain or "", columns.stress)
    )
    unit, (_, line) = unit_named(columns.unit), table_line(strain, stress)
    if unit is None or unit.quantity not in ("pressure", "force"):
        remedy = f"give kPa, MPa, Pa, psi or bar, as in: {line}"
        raise InputError(path, "recordings.table.unit", f"'{columns.unit}' is not a unit of stress", remedy)
    if stress.quantity in ("pressure", "force") and stress.known_unit != unit:
        problem = f"'{columns.unit}', but the file says '{stress.unit}'"
        raise InputError(path, "recordings.table.unit", problem, f"correct one of them, as in: {line}")
    values, loads = strain.values, stress.values * unit.factor / (area if columns.of_force else 1.0)
    rows = np.isfinite(values) & np.isfinite(loads)
    values, loads = values[rows], loads[rows]
    if columns.stretch is not None:
        if len(values) and values.min() <= 0:
            problem = f"a stretch of {values.min():.4g} is impossible"
            problem += ": it is the length divided by the undeformed length"
            remedy = f"if it is a strain, give: {line.replace('stretch =', 'strain =')}"
            raise InputError(path, f"'{strain.name}'", problem, remedy)
        values = values - 1
    elif columns.percent:
        values = values / 100
    if len(values) < _LEAST_ROWS:
        raise InputError(path, "rows", f"{len(values)} rows are too few", f"give at least {_LEAST_ROWS}")
    return values, loads


def _column(path: Path, sheet: Sheet, name: str) -> Column:
    found = sheet.named(name)
    if len(found) == 1:
        return found[0]
    names = ", ".join(f"'{c.name}'" for c in sheet.columns)
    seen = stretch_and_stress(sheet)
    as_in = f", as in: {table_line(*seen)[1]}" if seen else ""
    problem = f"there is not exactly one column '{name}'"
    raise InputError(path, "recordings.table", problem, f"give one of {names}{as_in}")


def roughness(strain: FloatArray, load: FloatArray) -> float:
    """Return the standard deviation of loads (n,) about a smooth curve of the strain (n,), in the loads' unit.

    By divided differences of third order, which a parabola doesn't have, over what white noise would make of each (the
    table's steps may differ), and by the median of their size.
    """
    order = np.argsort(strain, kind="stable")
    x, y = strain[order], load[order]
    kept = np.append(True, np.diff(x) > 1e-9 * np.ptp(x))
    x, y = x[kept], y[kept]
    if len(x) <= _ORDER:
        return 0.0
    windows = np.lib.stride_tricks.sliding_window_view(x, _ORDER + 1)
    apart = windows[:, :, None] - windows[:, None, :] + np.eye(_ORDER + 1)
    weights = 1 / apart.prod(axis=2)
    seen = (weights * np.lib.stride_tricks.sliding_window_view(y, _ORDER + 1)).sum(axis=1)
    return float(1.4826 * np.median(np.abs(seen) / np.sqrt((weights**2).sum(axis=1))))

"""Which column of a table is a recording's time, displacement or force, by its unit or its name."""

import re
from pathlib import Path

import numpy as np

from legfem.channels.kinds import CHANNELS
from legfem.common.errors import InputError
from legfem.data.formats.labels import OWN, Quantity, Unit, names_quantity, unit_named
from legfem.data.formats.sheet import Column, Sheet
from legfem.data.recording import QUANTITIES, SourceColumn, channel_of

# What a test of soft tissue lasts, and how far apart its readings are.
_LEAST_TEST_S, _LONGEST_TEST_S = 0.5, 10_000.0
_LEAST_STEP_S, _LONGEST_STEP_S = 1e-4, 5.0

_COMMANDED = re.compile(
    r"command|\bcmd\b|set[ _]?point|sollwert|consigne|target|ref$"
    r"|\b(?:peak|max|maximum|min|minimum|mean|average|avg)\b",
    re.IGNORECASE,
)
"""What a drive was told to do, a second sensor that another is compared with, a statistic: no reading of the test."""


def find_column(path: Path, sheet: Sheet, quantity: Quantity, given: str | None) -> tuple[SourceColumn, str]:
    """Find the column of a quantity, and say why it is that; ``given`` is what a user named.

    Raises
    ------
    InputError
        If there is none, or several that differ, or no unit.
    """
    if given is not None:
        # A name may have a colon, too.
        whole = any(c.name == given for c in sheet.columns)
        name, _, unit = (given, "", "") if whole or ":" not in given else given.rpartition(":")
        columns = [c for c in sheet.columns if c.name == name]
        columns = [c for c in columns if not unit or unit_named(c.unit or unit) == unit_named(unit)] or columns
        if len(columns) != 1 or not (unit or columns[0].unit):
            names = ", ".join(f"'{c.name}'" for c in sheet.columns)
            missing = "has no unit" if columns else "is not a column of the file"
            raise InputError(path, f"--{quantity}", f"'{name}' {missing}", f"give NAME:UNIT of {names}")
        channel = SourceColumn(name, unit or str(columns[0].unit))
        return channel, f"{quantity}: '{name}' in {channel.unit}, as you say"
    able = [c for c in sheet.columns if may_be(c, quantity)]
    # A testing machine calls its only force axial, which is a channel beside the force in another's file.
    candidates = [c for c in able if channel_of(c) is None]
    candidates = candidates or [c for c in able if channel_of(c) == CHANNELS["axial_force"]]
    names = ", ".join(f"'{c.name}'" for c in sheet.columns)
    if not candidates:
        alike = [c for c in sheet.columns if names_quantity(c.name, quantity)]
        why = f"no column is named, or has a unit, like it (of {names})"
        if alike:
            why = f"'{alike[0].unit}' of '{alike[0].name}' is not a unit of {quantity}"
        raise InputError(path, f"recordings.{quantity}", why, f"name it with --{quantity} NAME:UNIT")
    named = [c for c in candidates if names_quantity(c.name, quantity)]
    able = named or candidates
    able = [c for c in able if not _COMMANDED.search(c.name)] or able
    going = [c for c in able if _goes_on(c, quantity)] or able
    chosen, others = going[0], going[1:]
    differing = [c.name for c in others if not _same_signal(c, chosen)]
    told = ", ".join(f"'{n}'" for n in (chosen.name, *differing))
    if differing and _side_by_side(sheet):
        raise InputError(
            path,
            ABREAST,
            f"{len(differing) + 1} trials stand side by side: {told}",
            "save each trial in a file of its own",
        )
    if differing:
        raise InputError(
            path,
            f"recordings.{quantity}",
            f"may be any of {told}, which differ",
            f"name it with --{quantity} NAME:UNIT",
        )
    if quantity == "time":
        _check_no_clock(path, chosen)
    still = "doesn't increase" if quantity == "time" else "doesn't change"
    same = "".join(f"; '{c.name}' {still}" for c in able if not _goes_on(c, quantity) and c is not chosen)
    if not chosen.unit and quantity == "time" and (of_time := _unit_of_time(chosen)):
        unit, reason = of_time
        return SourceColumn(chosen.name, unit), f"time: '{chosen.name}' in {unit}, since {reason}{same}"
    if not chosen.unit:
        raise InputError(
            path,
            f"recordings.{quantity}.unit",
            f"column '{chosen.name}' has no unit",
            f"give it with --{quantity} '{chosen.name}:{OWN[quantity]}', if it is that",
        )
    if unit_named(chosen.unit) is None:
        raise InputError(
            path,
            f"recordings.{quantity}.unit",
            f"'{chosen.unit}' of '{chosen.name}' is not a known unit",
            f"give it with --{quantity} '{chosen.name}:UNIT' in multiples of {OWN[quantity]}",
        )
    same += f"; {len(others)} more say the same" if others else ""
    why = "name and unit" if named else "unit"
    passed = [c.name for c in candidates if c not in able]
    if passed:
        same += "; passed over, by their names: " + ", ".join(f"'{name}'" for name in passed)
    return SourceColumn(chosen.name, chosen.unit), (f"{quantity}: '{chosen.name}' in {chosen.unit}, by its {why}{same}")


ABREAST = "columns"
"""Field of a refusal of trials that stand side by side."""
_NUMBER = re.compile(r"[#\s_:.-]*\d+[:\s]*")


def _side_by_side(sheet: Sheet) -> bool:
    """Tell whether displacement and force have as many columns each of one name, or of one but for a number."""
    names = [(_NUMBER.sub("", c.name), unit_named(c.unit or "")) for c in sheet.columns]
    counts = [
        max((names.count(name) for c, name in zip(sheet.columns, names, strict=True) if may_be(c, quantity)), default=0)
        for quantity in QUANTITIES
    ]
    return counts[1] == counts[2] > 1 and counts[0] in (1, counts[1])


def _goes_on(column: Column, quantity: Quantity) -> bool:
    """Tell whether a column can be a test's: a time that increases, another that changes."""
    if quantity == "time":
        return bool((np.diff(column.values[1:]) > 0).all())
    return bool(np.ptp(column.values) > 0)


def _unit_of_time(column: Column) -> tuple[str, str] | None:
    """Return the one unit in which a time without a unit is a test's, and why; None where several may be.

    In days a spreadsheet keeps a date's time.
    """
    whole = float(np.ptp(column.values))
    step = whole / max(len(column.values) - 1, 1)
    units = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "days": 86400.0}
    fits = [
        unit
        for unit, factor in units.items()
        if _LEAST_TEST_S <= factor * whole <= _LONGEST_TEST_S and _LEAST_STEP_S <= factor * step <= _LONGEST_STEP_S
    ]
    if not _goes_on(column, "time") or len(fits) != 1:
        return None
    unit = fits[0]
    other = "ms" if unit == "s" else "s"
    factor = units[other]
    would = f"the test would last {factor * whole:.3g} s, with a reading every {factor * step:.2g} s"
    return unit, f"it has no unit, and in {other} {would}"


_STAMPS = ((1.9e11, 2.1e11), (1.9e13, 2.1e13), (1.9e16, 2.1e16))
"""Years, months, days, hours, minutes, seconds and milliseconds as the figures of one number."""
_SIXTIES = {100.0: "hours, minutes and seconds (hhmmss)", 1.0: "minutes and seconds (m.ss)"}
"""What a number counts whose last part begins anew at 60, by the number's unit before that part."""


def _check_no_clock(path: Path, column: Column) -> None:
    """Refuse times whose figures are a date's, or a clock's hours, minutes and seconds, in one number."""
    values, remedy = column.values, "export time in seconds since the start"
    if not column.unit and any(low <= values[0] and values[-1] <= high for low, high in _STAMPS):
        raise InputError(path, f"column '{column.name}'", f"has dates as numbers ({values[0]:.0f})", remedy)
    steps = np.diff(values)
    step = float(np.median(steps)) if len(steps) else 0.0
    for whole, what in _SIXTIES.items():
        parts = np.mod(values, whole) / whole
        begun = np.flatnonzero(np.diff(np.floor(values / whole)) == 1)
        small = 3.0 * step / whole
        jumps = (parts[begun] > 0.6 - small) & (parts[begun + 1] < small) & (steps[begun] > 5.0 * step)
        if 0 < small < 0.3 and len(begun) and (parts < 0.6).all() and jumps.all():
            k = int(begun[0])
            problem = f"jumps from {values[k]:.10g} to {values[k + 1]:.10g}: it may count {what}"
            raise InputError(path, f"column '{column.name}'", problem, remedy)


def may_be(column: Column, quantity: Quantity) -> bool:
    """Tell whether a column may be a quantity, by its unit; by its name where that says nothing."""
    unit: Unit | None = unit_named(column.unit) if column.unit else None
    if unit is not None:
        return unit.quantity == quantity
    return names_quantity(column.name, quantity)


def _same_signal(a: Column, b: Column) -> bool:
    """Tell whether one signal is the other but for sign, unit and zero; one that is twice as large isn't."""
    one, other = (c.values * (unit_named(c.unit or "") or Unit(None, 1.0)).factor for c in (a, b))
    if np.ptp(one) == 0 or np.ptp(other) == 0:
        return bool(np.ptp(one) == np.ptp(other) == 0)
    alike = abs(np.corrcoef(one, other)[0, 1]) > 1 - 1e-6
    return bool(alike and abs(np.ptp(one) / np.ptp(other) - 1) < 0.01)

"""Which columns of a table are a recording's, by unit and name; what reads a file in which that can't be determined."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from legfem.channels.kinds import CHANNELS
from legfem.common.errors import Argument, Command, InputError, Remedy
from legfem.data.formats.labels import UNIT_OF, Quantity, names_quantity, unit_named
from legfem.data.formats.refused import refuse_other_kind
from legfem.data.formats.sheet import FEWEST_ROWS, NAMELESS, NOT_CALCULATED, Column, Sheet
from legfem.data.formats.times import check_no_clock
from legfem.data.phases import before_tear
from legfem.data.recording import QUANTITIES, Recording, SourceColumn, SourceColumns, channel_of, recording_of
from legfem.data.stress_tables import refuse_untimed, stretch_and_stress

_LEAST_TEST_S, _LONGEST_TEST_S = 0.5, 10_000.0
"""Bounds of the duration of a test of soft tissue."""
_LEAST_STEP_S, _LONGEST_STEP_S = 1e-4, 5.0
"""Bounds of the time between its readings."""

_COMMANDED = re.compile(
    r"command|\bcmd\b|set[ _]?point|sollwert|consigne|target|ref$"
    r"|\b(?:peak|max|maximum|min|minimum|mean|average|avg)\b",
    re.IGNORECASE,
)
"""What a drive was told to do, a second sensor that another is compared with, a statistic: no reading of the test."""

_PRESSING = tuple(kind for kind in CHANNELS.values() if kind.presses)
"""Channels that a machine with one force axis presses by."""


def find_column(path: Path, sheet: Sheet, quantity: Quantity, given: str | None) -> tuple[SourceColumn, str]:
    """Find the column of a quantity, and say why it is that; ``given`` is what a user named.

    Raises
    ------
    InputError
        If there is none, or several that differ, or no unit.
    """
    names = ", ".join(f"'{c.name}'" for c in sheet.columns)
    if given is not None:
        # A name may have a colon, too.
        whole = any(c.name == given for c in sheet.columns)
        name, _, unit = (given, "", "") if whole or ":" not in given else given.rpartition(":")
        columns = sheet.named(name)
        columns = [c for c in columns if not unit or unit_named(c.unit or unit) == unit_named(unit)] or columns
        if len(columns) != 1 or not (unit or columns[0].unit):
            missing = "has no unit" if columns else "is not a column of the file"
            raise InputError(path, Argument(quantity), f"'{name}' {missing}", f"give NAME:UNIT of {names}")
        channel = SourceColumn(name, unit or str(columns[0].unit))
        told = f"{quantity}: '{name}' in {channel.unit}, as you say"
        forces = (c for c in sheet.columns if c.name != name and c.quantity == "force" and not channel_of(c))
        if quantity == "force" and (unread := ", ".join(f"'{c.name}'" for c in forces)):
            told += f"; not read: {unread}. Forces across the travel and along the leg are read from columns "
            told += "called lateral_force and axial_force"
        return channel, told
    able = [c for c in sheet.columns if may_be(c, quantity)]
    # A testing machine calls its only force axial, which is a channel beside the force in another's file.
    candidates = [c for c in able if channel_of(c) is None]
    candidates = candidates or [c for c in able if channel_of(c) in _PRESSING]
    name_it = Remedy("name it with ", Argument(quantity, "NAME:UNIT"))
    if not candidates:
        named_so = [c for c in sheet.columns if names_quantity(c.name, quantity)]
        why = f"no column is named, or has a unit, like it (of {names})"
        if named_so:
            why = f"'{named_so[0].unit}' of '{named_so[0].name}' is not a unit of {quantity}"
        raise InputError(path, f"recordings.{quantity}", why, name_it)
    named = [c for c in candidates if names_quantity(c.name, quantity)]
    able = named or candidates
    able = [c for c in able if not _COMMANDED.search(c.name)] or able
    going = [c for c in able if _goes_on(c, quantity)] or able
    chosen, others = going[0], going[1:]
    differing = [c.name for c in others if not _same_signal(c, chosen)]
    told = ", ".join(f"'{n}'" for n in (chosen.name, *differing))
    if differing and _side_by_side(sheet):
        problem = f"{len(differing) + 1} trials stand side by side: {told}"
        raise InputError(path, ABREAST, problem, "save each trial in a file of its own")
    if differing:
        raise InputError(path, f"recordings.{quantity}", f"may be any of {told}, which differ", name_it)
    if quantity == "time":
        check_no_clock(path, chosen.name, chosen.unit, chosen.values)
    still = "doesn't increase" if quantity == "time" else "doesn't change"
    same = "".join(f"; '{c.name}' {still}" for c in able if not _goes_on(c, quantity) and c is not chosen)
    if not chosen.unit and quantity == "time" and (of_time := _unit_of_time(chosen)):
        unit, reason = of_time
        return SourceColumn(chosen.name, unit), f"time: '{chosen.name}' in {unit}, since {reason}{same}"
    if not chosen.unit or chosen.known_unit is None:
        problem = f"'{chosen.unit}' of '{chosen.name}' is not a known unit"
        how = f" '{chosen.name}:UNIT' in multiples of {UNIT_OF[quantity]}"
        if not chosen.unit:
            problem = f"column '{chosen.name}' has no unit"
            how = f" '{chosen.name}:{UNIT_OF[quantity]}', if it is that"
        remedy = Remedy("give it with ", Argument(quantity), how)
        raise InputError(path, f"recordings.{quantity}.unit", problem, remedy)
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
    names = [(_NUMBER.sub("", c.name), c.known_unit) for c in sheet.columns]
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


def may_be(column: Column, quantity: Quantity) -> bool:
    """Tell whether a column may be a quantity, by its unit; by its name where that says nothing."""
    return names_quantity(column.name, quantity) if column.known_unit is None else column.quantity == quantity


def _same_signal(a: Column, b: Column) -> bool:
    """Tell whether one signal is the other but for sign, unit and zero; one that is twice as large isn't."""
    one, other = (c.values * c.factor for c in (a, b))
    if np.ptp(one) == 0 or np.ptp(other) == 0:
        return bool(np.ptp(one) == np.ptp(other) == 0)
    proportional = abs(np.corrcoef(one, other)[0, 1]) > 1 - 1e-6
    return bool(proportional and abs(np.ptp(one) / np.ptp(other) - 1) < 0.01)


# How sure the force has to follow the displacement for their directions to be told.
_LEAST_CORRELATION = 0.6
_MOST_IN_A_ROW = 50
"""Numbers in a row, beyond which a table of few rows is one that lies on its side."""
_MOST_COLUMNS = 16
"""Columns without names from which on a table is no recording, but a frame."""
_BY_PLACE = ("column 1:UNIT", "column 2:UNIT", "column 3:UNIT")


@dataclass(frozen=True)
class Proposal:
    """Columns that were found, and why each is taken for what it is."""

    channels: SourceColumns
    reasons: tuple[str, ...]


def propose(
    path: Path, sheets: Sequence[Sheet], given: dict[Quantity, str] | None = None, named: str | None = None
) -> Proposal:
    """Find the columns, units and directions of a pressing test in a file's tables.

    A column is taken by its unit or its name; what can't be told is refused, not guessed. The
    directions are those in which the indenter presses: the force changes as it moves away from
    where it began.

    Parameters
    ----------
    path : Path
        Path of the file, for errors.
    sheets : sequence of Sheet
        Its tables.
    given : dict, optional
        ``NAME`` or ``NAME:UNIT`` of columns that a user named.
    named : str, optional
        The table, where a user named it.

    Raises
    ------
    InputError
        If a quantity has no column, or several that differ, or no unit; if several tables hold
        recordings; if directions can't be told.
    """
    given = given or {}
    usable, why = [], None
    for sheet in sheets:
        try:
            usable.append((sheet, [find_column(path, sheet, q, given.get(q)) for q in QUANTITIES]))
        except InputError as error:
            why = why or (sheet, error)
    columns = [c for sheet in sheets for c in sheet.columns]
    names = [c.name for c in columns] + [f"<{c.quantity}>" for c in columns]
    if not given:
        refuse_other_kind(path, names, ("swings", "bends") if usable else ())
    if not usable:
        assert why is not None
        table = next((sheet for sheet in sheets if stretch_and_stress(sheet)), None)
        if table is not None and not given:
            raise refuse_untimed(path, table)
        sheet, first = why
        if not given:
            refuse_other_table(path, sheets)
        remedy = first.args[-1] if isinstance(first.args[1], Argument) else remedy_for(path, sheet, given, sheets)
        raise InputError(path, first.args[1], first.problem, remedy)
    if len(usable) > 1:
        few = ", ".join(f"'{sheet.name}'" for sheet, _ in usable)
        remedy = Remedy("name one: ", look_command(path, {"sheet": usable[0][0].name}))
        raise InputError(path, "recordings.sheet", f"{len(usable)} tables contain recordings: {few}", remedy)
    sheet, found = usable[0]
    (time, _), (displacement, _), (force, _) = found
    _check_not_exchanged(path, displacement, force, given)
    plain = SourceColumns(time, displacement, force, sheet.name if len(sheets) > 1 else named)
    d_sign, f_sign, reason = _directions(path, recording_of(path, sheets, plain), () if given else names)
    signed = replace(plain, displacement=replace(displacement, sign=d_sign), force=replace(force, sign=f_sign))
    return Proposal(signed, (*sheet.remarks, *(reason for _, reason in found), reason))


def _check_not_exchanged(
    path: Path, displacement: SourceColumn, force: SourceColumn, given: Mapping[Quantity, str]
) -> None:
    """Refuse names of displacement and force that contradict their units."""
    own, other = names_quantity(force.column, "force"), names_quantity(force.column, "displacement")
    if names_quantity(displacement.column, "force") and other and not own and not given:
        problem = f"'{displacement.column}' is in {displacement.unit}, and '{force.column}' in {force.unit}"
        raise InputError(path, "columns", problem, "correct the names or the units")


def _directions(path: Path, recording: Recording, names: Sequence[str]) -> tuple[int, int, str]:
    """Return the signs with which displacement and force grow in the first press, and why; of what is no other test."""
    d, f = recording.displacement, recording.force
    if len(d) < FEWEST_ROWS:
        raise InputError(path, "rows", f"{len(d)} samples are not a whole press", f"record at least {FEWEST_ROWS}")
    few = max(3, len(d) // 200)
    away = d - np.median(d[:few])
    change = f - np.median(f[:few])
    turned = int(np.argmax(np.abs(away) > 0.9 * np.abs(away).max())) + 1
    if turned < 5 or np.ptp(away[:turned]) == 0 or np.ptp(change[:turned]) == 0:
        refuse_other_kind(path, names)
        raise InputError(path, "recordings", "displacement or force doesn't change", "record a whole press")
    turned = min(turned, max(5, before_tear(recording.time, np.abs(away), f)))
    together = float(np.corrcoef(away[:turned], change[:turned])[0, 1])
    if abs(together) < _LEAST_CORRELATION:
        refuse_other_kind(path, names)
        problem = f"it doesn't follow the displacement (correlation {together:.2f})"
        problem += ", so the directions cannot be determined"
        remedy = "look at the file: does the indenter touch, and are these the right columns?"
        raise InputError(path, "recordings.force", problem, remedy)
    d_sign = int(np.sign(away[turned - 1]))
    f_sign = int(np.sign(together)) * d_sign
    moves = f"the displacement changes by {away[turned - 1]:+.3g} mm"
    reads = f"the force by {change[:turned][np.argmax(np.abs(change[:turned]))]:+.3g} N"
    why = f"directions: {moves} and {reads}; both must grow during loading, so the sign of displacement is {d_sign:+d} "
    return d_sign, f_sign, f"{why}and that of force {f_sign:+d}"


def refuse_other_table(path: Path, sheets: Sequence[Sheet]) -> None:
    """Refuse tables of which none has a recording's quantities: readings beside a force, or something else."""
    refused = partial(InputError, path, "columns")
    columns = [column for sheet in sheets for column in sheet.columns]
    kind = next((kind for column in columns if (kind := channel_of(column))), None)
    has = {quantity: [c for c in columns if may_be(c, quantity) and not channel_of(c)] for quantity in QUANTITIES}
    # A machine that calls its only force axial moves, too.
    pressing = kind in _PRESSING and has["displacement"]
    if kind is not None and has["time"] and not has["force"] and not pressing:
        problem = f"contains {len(columns[0].values)} readings of {kind.name} and no force: it goes with a recording"
        entry = f"[channels.{kind.name}] file = {json.dumps(path.name)} (or a file a trial, with {{trial}} for the "
        raise refused(problem, f"give in subject.toml, beside the recordings: {entry}trial's name)")
    strained = next((pair for sheet in sheets if (pair := stretch_and_stress(sheet, timed=True))), None)
    if strained is not None and has["time"] and not has["displacement"] and not has["force"]:
        problem = f"contains strain ('{strained[0].name}') and stress ('{strained[1].name}') over time and no force"
        remedy = "export displacement in mm and force in N, which are strain times length and stress times area"
        raise refused(problem, remedy)
    strain = next((c.name for c in columns if re.search("strain|dehnung|stretch", c.name, re.IGNORECASE)), None)
    if strain is not None and has["time"] and has["force"] and not has["displacement"]:
        problem = f"contains strain ('{strain}') and force over time and no displacement"
        raise refused(problem, "export displacement in mm, which is strain times length")
    pressures = [c for c in columns if c.quantity == "pressure"]
    if pressures and has["time"] and has["displacement"] and not has["force"]:
        problem = f"contains a pressure ('{pressures[0].name}' in {pressures[0].unit}) and no force"
        described = "of a suction cup describe the test in specimen.toml, in the table [suction], beside recordings/"
        look = Command("data preview", given=str(path.parent.parent))
        raise refused(problem, Remedy(f"{described}, and run: ", look))
    formulas = next((remark for sheet in sheets for remark in sheet.remarks if NOT_CALCULATED in remark), None)
    if formulas is not None:
        raise InputError(path, "file", f"its {formulas}", "open it in a spreadsheet, and save it")
    nameless = next((sheet for sheet in sheets if NAMELESS in sheet.remarks), None)
    if nameless is not None and not any(has.values()):
        raise _without_names(path, nameless)
    if not any(has.values()):
        few = ", ".join(f"'{c.name}'" for c in columns[:6]) + (", ..." if len(columns) > 6 else "")
        raise refused(
            f"is not a recording: none of its columns ({few}) has a name or unit of time, displacement or force",
            Remedy("if three of them are, name them: ", look_command(path, dict.fromkeys(QUANTITIES, "NAME:UNIT"))),
        )


def _without_names(path: Path, sheet: Sheet) -> InputError:
    refused = partial(InputError, path, "columns")
    count, first = len(sheet.columns), sheet.columns[0].values
    if len(first) < FEWEST_ROWS and count > _MOST_IN_A_ROW:
        remedy = "turn the table round: in a spreadsheet, Paste Special, Transpose"
        return refused(f"its numbers are in rows of {count}, not in columns", remedy)
    if count >= _MOST_COLUMNS:
        problem = f"has {count} columns without names, as a camera's or film's frame"
        return refused(problem, "give a row a point and frame")
    to_zero = first[0] < 0 and abs(first[-1]) < 0.01 * abs(first[0])
    height = to_zero and np.ptp(np.diff(first)) < 0.01 * np.ptp(first)
    odd = "; the first goes up to 0 in equal steps, as a microscope's height does and no time" if height else ""
    write = "write a line of names above the numbers, such as time_s,displacement_mm,force_N"
    look = look_command(path, dict(zip(QUANTITIES, _BY_PLACE, strict=True)))
    return refused(f"its {count} columns have no names{odd}", Remedy(f"{write}, or name them by their places: ", look))


def remedy_for(path: Path, sheet: Sheet, given: Mapping[Quantity, str], sheets: Sequence[Sheet]) -> str | Remedy:
    """Return what would make legfem read a file, with the units that are to be confirmed or filled in."""
    options: dict[str, str] = {str(quantity): text for quantity, text in given.items()}
    assumed: list[str] = []
    for quantity in QUANTITIES:
        try:
            find_column(path, sheet, quantity, given.get(quantity))
        except InputError as error:
            if error.field == ABREAST:
                return _first_abreast(path, sheet) or error.args[-1]
            named = [c for c in sheet.columns if names_quantity(c.name, quantity)]
            able = [c for c in named if c.quantity in (quantity, None)]
            moved = options.get("displacement", "").rpartition(":")[0]
            along = [c for c in able if moved and _axes(c.name) == _axes(moved)]
            # Of several axes the one that is moved along, or pressed along, changes most.
            column = max(along or able, key=lambda c: float(np.ptp(c.values)), default=None)
            stated = None if column is None else column.known_unit
            if column is None:
                options[quantity] = "NAME:UNIT"
            elif stated is not None and stated.quantity is None:
                return f"export '{column.name}' in {UNIT_OF[quantity]}, or correct its unit in the file"
            elif column.unit and stated is None and re.search(r"\d", column.unit):
                return f"export '{column.name}' in {UNIT_OF[quantity]}: '{column.unit}' has a factor in it"
            elif sum(c.name == column.name for c in sheet.columns) > 1:
                return f"give the columns '{column.name}' names of their own in the file, then name one"
            else:
                unit = _likely_unit(column, quantity)
                options[quantity] = f"{column.name}:{unit}"
                assumed.append(f"{quantity} is '{column.name}' in {unit}")
    if len(sheets) > 1 and sheet.name:
        options["sheet"] = sheet.name
    missing = [quantity for quantity, text in options.items() if text == "NAME:UNIT"]
    if not missing:
        unknown = any(text.endswith(":UNIT") for text in options.values())
        told = "give in place of UNIT what it means" if unknown else f"if {', '.join(assumed)}"
        return Remedy(f"{told}: ", look_command(path, options))
    if missing == ["time"] and not any(c.quantity == "time" for c in sheet.columns):
        return "add a column Time (s): the number of the sample over the samples taken in a second"
    taken = {text.rpartition(":")[0] for text in options.values()}
    left = [c.name for c in sheet.columns if c.name not in taken and (c.known_unit is None or c.quantity in missing)]
    if len(left) < len(missing):
        return f"record {' and '.join(missing)}, too, and export all three columns"
    among = f" (of {', '.join(map(repr, left))})"
    return Remedy(f"name {' and '.join(missing)}{among}: ", look_command(path, options))


_AXIS = re.compile(r"(?<![A-Za-z])[xyzXYZ](?![a-z])|(?<=[a-z])[XYZ]$|\d+")


def _axes(name: str) -> list[str]:
    """Return the axis, and the number, that a column's name says, as the X of ``XForce``."""
    return [one.lower() for one in _AXIS.findall(name)]


def _first_abreast(path: Path, sheet: Sheet) -> Remedy | None:
    """Return how the first of trials side by side is read; None where their columns have the same names."""
    first = {quantity: next(c for c in sheet.columns if may_be(c, quantity)) for quantity in QUANTITIES}
    names = [c.name for c in sheet.columns]
    if any(names.count(c.name) > 1 or not c.unit for c in first.values()):
        return None
    look = look_command(path, {quantity: f"{c.name}:{c.unit}" for quantity, c in first.items()})
    return Remedy("keep one trial a file; the first is read by: ", look)


def _likely_unit(column: Column, quantity: Quantity) -> str:
    """Return the unit that a column is said to be in, perhaps by a sign that an encoding lost; else legfem's own."""
    if not column.unit:
        return UNIT_OF[quantity]
    if column.quantity == quantity:
        return column.unit
    return "u" + column.unit[1:] if column.unit[0] in "?\ufffd" and column.quantity is None else "UNIT"


def look_command(path: Path, options: Mapping[str, str]) -> Command:
    """Return the look at a file that reads it with options."""
    return Command("data look", tuple(Argument(key, value) for key, value in options.items()), str(path))

"""Reading a recording: which columns are time, displacement and force, and what would read a file that is refused."""

import json
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from legfem.channels.kinds import CHANNELS
from legfem.common.errors import InputError
from legfem.data.columns import ABREAST, find_column, may_be
from legfem.data.formats import read_sheets
from legfem.data.formats.labels import OWN, Quantity, names_quantity, unit_named
from legfem.data.formats.sheet import FEWEST_ROWS, NAMELESS, NOT_CALCULATED, Column, Sheet, measured_by, measures
from legfem.data.formats.times import BY_RATE
from legfem.data.recording import (
    QUANTITIES,
    Recording,
    SourceColumn,
    SourceColumns,
    channel_of,
    read_own_table,
    recording_of,
)
from legfem.data.stress_tables import refuse_untimed, stretch_and_stress

# How sure the force has to follow the displacement for their directions to be told.
_LEAST_CORRELATION = 0.6
_MOST_IN_A_ROW = 50
"""Numbers in a row, beyond which a table of few rows is one that lies on its side."""
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
        Of the file, for errors.
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
    if not usable:
        assert why is not None
        table = next((sheet for sheet in sheets if stretch_and_stress(sheet)), None)
        if table is not None and not given:
            raise refuse_untimed(path, table)
        sheet, first = why
        if not given:
            refuse_other_table(path, sheets)
        remedy = first.remedy if first.field.startswith("--") else remedy_for(path, sheet, given, sheets)
        raise InputError(path, first.field, first.problem, remedy)
    if len(usable) > 1:
        names = ", ".join(f"'{sheet.name}'" for sheet, _ in usable)
        raise InputError(
            path,
            "recordings.sheet",
            f"{len(usable)} tables contain recordings: {names}",
            f"save each trial in a file of its own, or name one: {look_command(path, {'sheet': usable[0][0].name})}",
        )
    sheet, found = usable[0]
    (time, _), (displacement, _), (force, _) = found
    reasons = [*sheet.remarks, *(reason for _, reason in found)]
    plain = SourceColumns(time, displacement, force, sheet.name if len(sheets) > 1 else named)
    recording = recording_of(path, sheets, plain)
    d_sign, f_sign, reason = _directions(path, recording)
    channels = SourceColumns(
        time,
        SourceColumn(displacement.column, displacement.unit, d_sign),
        SourceColumn(force.column, force.unit, f_sign),
        plain.sheet,
    )
    return Proposal(channels, (*reasons, reason))


def _directions(path: Path, recording: Recording) -> tuple[int, int, str]:
    """Return the signs with which displacement and force grow in the first press, and why."""
    d, f = recording.displacement, recording.force
    if len(d) < FEWEST_ROWS:
        raise InputError(path, "rows", f"{len(d)} samples are not a whole press", f"record at least {FEWEST_ROWS}")
    few = max(3, len(d) // 200)
    away = d - np.median(d[:few])
    change = f - np.median(f[:few])
    turned = int(np.argmax(np.abs(away) > 0.9 * np.abs(away).max())) + 1
    if turned < 5 or np.ptp(away[:turned]) == 0 or np.ptp(change[:turned]) == 0:
        raise InputError(path, "recordings", "displacement or force doesn't change", "record a whole press")
    together = float(np.corrcoef(away[:turned], change[:turned])[0, 1])
    if abs(together) < _LEAST_CORRELATION:
        raise InputError(
            path,
            "recordings.force",
            f"it doesn't follow the displacement (correlation {together:.2f}), so the directions cannot be determined",
            "look at the file: does the indenter touch, and are these the right columns?",
        )
    d_sign = int(np.sign(away[turned - 1]))
    f_sign = int(np.sign(together)) * d_sign
    moves = f"the displacement changes by {away[turned - 1]:+.3g} mm"
    reads = f"the force by {change[:turned][np.argmax(np.abs(change[:turned]))]:+.3g} N"
    return (
        d_sign,
        f_sign,
        (
            f"directions: {moves} and {reads}; both must grow during loading, so the sign of displacement is "
            f"{d_sign:+d} and that of force {f_sign:+d}"
        ),
    )


def read_samples(path: Path, channels: SourceColumns | None = None, area: float | None = None) -> Recording:
    """Read one trial whatever it holds, only that time increases.

    Parameters
    ----------
    path : Path
        The file.
    channels : SourceColumns, optional
        Where an instrument's file holds the quantities; legfem's own CSV without it.
    area : float, optional
        mm2; a pressure on it is read in the force's place: a column ``pressure_kPa``,
        ``pressure_mbar`` or ``pressure_mmHg`` of the CSV.

    Raises
    ------
    InputError
        If the table can't be read (see `legfem.common.input_files.read_table`), or if the file lacks what
        ``channels`` name.
    """
    path = Path(path)
    if channels is not None:
        return recording_of(path, read_sheets(path), channels, area)
    if _breaks_off(path) and (found := _other_dialect(path, area)) is not None:
        return found
    try:
        return read_own_table(path, area)
    except InputError as error:
        if not path.is_file() or error.field == "rows":
            raise
        found = _other_dialect(path, area)
        if found is not None:
            return found
        if error.field == "header" and area is None and (seen := _seen(path)):
            remedy = f"{error.remedy}; or run {look_command(path, {})}, whose recordings.toml reads {seen}"
            raise InputError(path, error.field, error.problem, remedy) from None
        raise


def _breaks_off(path: Path) -> bool:
    """Tell whether a file doesn't end where a line does: its last number may be cut."""
    if not path.is_file() or path.stat().st_size == 0:
        return False
    with path.open("rb") as file:
        file.seek(-1, 2)
        return file.read(1) not in b"\r\n"


def _other_dialect(path: Path, area: float | None) -> Recording | None:
    """Return what a table of another dialect than legfem's own CSV holds; None where that isn't said clearly.

    Clear are columns by name and unit, which grow as the test presses: nothing of them is guessed.
    """
    try:
        sheets = read_sheets(path)
        if area is not None:
            columns = {c.name: c for c in sheets[0].columns}
            unit = columns["pressure"].unit if "pressure" in columns else None
            own = SourceColumns(
                SourceColumn("time", "s"), SourceColumn("displacement", "mm"), SourceColumn("pressure", unit or "")
            )
            return recording_of(path, sheets, own, area)
        found = propose(path, sheets).channels
    except InputError:
        return None
    stated = all(c.unit for sheet in sheets for c in sheet.columns if c.name == found.time.column)
    counted = any(BY_RATE in remark for sheet in sheets for remark in sheet.remarks)
    if found.displacement.sign < 0 or found.force.sign < 0 or not stated or counted:
        return None
    return recording_of(path, sheets, found)


def _seen(path: Path) -> str:
    """Return as what `legfem.data look` reads a file's columns; empty where it doesn't."""
    try:
        found = propose(path, read_sheets(path)).channels
    except InputError:
        return ""
    return ", ".join(f"{q} from '{getattr(found, q).column}' in {getattr(found, q).unit}" for q in QUANTITIES)


def refuse_other_table(path: Path, sheets: Sequence[Sheet]) -> None:
    """Refuse tables of which none has a recording's quantities: readings beside a force, or something else."""
    columns = [column for sheet in sheets for column in sheet.columns]
    kind = next((kind for column in columns if (kind := channel_of(column))), None)
    has = {quantity: [c for c in columns if may_be(c, quantity) and not channel_of(c)] for quantity in QUANTITIES}
    # A machine that calls its only force axial moves, too.
    pressing = kind == CHANNELS["axial_force"] and has["displacement"]
    if kind is not None and has["time"] and not has["force"] and not pressing:
        raise InputError(
            path,
            "columns",
            f"contains {len(columns[0].values)} readings of {kind.name} and no force: it goes with a recording",
            f"give in subject.toml, beside the recordings: [channels.{kind.name}] file = {json.dumps(path.name)} "
            "(or a file a trial, with {trial} for the trial's name)",
        )
    strained = next((pair for sheet in sheets if (pair := stretch_and_stress(sheet, timed=True))), None)
    if strained is not None and has["time"] and not has["displacement"] and not has["force"]:
        raise InputError(
            path,
            "columns",
            f"contains strain ('{strained[0].name}') and stress ('{strained[1].name}') over time and no force",
            "export displacement in mm and force in N, which are strain times length and stress times area",
        )
    pressures = [c for c in columns if measures(c, "pressure")]
    if pressures and has["time"] and has["displacement"] and not has["force"]:
        raise InputError(
            path,
            "columns",
            f"contains a pressure ('{pressures[0].name}' in {pressures[0].unit}) and no force",
            "of a suction cup describe the test in specimen.toml, in the table [suction], beside recordings/, and run: "
            f"legfem data preview {shlex.quote(str(path.parent.parent))}",
        )
    formulas = next((remark for sheet in sheets for remark in sheet.remarks if NOT_CALCULATED in remark), None)
    if formulas is not None:
        raise InputError(path, "file", f"its {formulas}", "open it in a spreadsheet, and save it")
    nameless = next((sheet for sheet in sheets if NAMELESS in sheet.remarks), None)
    if nameless is not None and not any(has.values()):
        raise _without_names(path, nameless)
    if not any(has.values()):
        few = ", ".join(f"'{c.name}'" for c in columns[:6]) + (", ..." if len(columns) > 6 else "")
        raise InputError(
            path,
            "columns",
            f"is not a recording: none of its columns ({few}) has a name or unit of time, displacement or force",
            f"if three of them are, name them: {look_command(path, dict.fromkeys(QUANTITIES, 'NAME:UNIT'))}",
        )


def _without_names(path: Path, sheet: Sheet) -> InputError:
    count, first = len(sheet.columns), sheet.columns[0].values
    if len(first) < FEWEST_ROWS and count > _MOST_IN_A_ROW:
        return InputError(
            path,
            "columns",
            f"its numbers are in rows of {count}, not in columns",
            "turn the table round: in a spreadsheet, Paste Special, Transpose",
        )
    to_zero = first[0] < 0 and abs(first[-1]) < 0.01 * abs(first[0])
    height = to_zero and np.ptp(np.diff(first)) < 0.01 * np.ptp(first)
    odd = "; the first goes up to 0 in equal steps, as a microscope's height does and no time" if height else ""
    return InputError(
        path,
        "columns",
        f"its {count} columns have no names{odd}",
        "write a line of names above the numbers, such as time_s,displacement_mm,force_N, or name them by their "
        f"places: {look_command(path, dict(zip(QUANTITIES, _BY_PLACE, strict=True)))}",
    )


def remedy_for(path: Path, sheet: Sheet, given: Mapping[Quantity, str], sheets: Sequence[Sheet]) -> str:
    """Return the command that would read a file, with the units that are to be confirmed or filled in."""
    options: dict[str, str] = {str(quantity): text for quantity, text in given.items()}
    assumed: list[str] = []
    for quantity in QUANTITIES:
        try:
            find_column(path, sheet, quantity, given.get(quantity))
        except InputError as error:
            if error.field == ABREAST:
                return _first_abreast(path, sheet) or error.remedy
            named = [c for c in sheet.columns if names_quantity(c.name, quantity)]
            able = [c for c in named if measured_by(c) in (quantity, None)]
            moved = options.get("displacement", "").rpartition(":")[0]
            along = [c for c in able if moved and _axes(c.name) == _axes(moved)]
            # Of several axes the one that is moved along, or pressed along, changes most.
            column = max(along or able, key=lambda c: float(np.ptp(c.values)), default=None)
            stated = unit_named(column.unit) if column is not None and column.unit else None
            if column is None:
                options[quantity] = "NAME:UNIT"
            elif stated is not None and stated.quantity is None:
                return f"export '{column.name}' in {OWN[quantity]}, or correct its unit in the file"
            elif column.unit and stated is None and re.search(r"\d", column.unit):
                return f"export '{column.name}' in {OWN[quantity]}: '{column.unit}' has a factor in it"
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
        return f"{told}: {look_command(path, options)}"
    if missing == ["time"] and not any(measured_by(c) == "time" for c in sheet.columns):
        return "add a column Time (s): the number of the sample over the samples taken in a second"
    taken = {text.rpartition(":")[0] for text in options.values()}
    left = [
        c.name
        for c in sheet.columns
        if c.name not in taken and (unit_named(c.unit or "") is None or measured_by(c) in missing)
    ]
    if len(left) < len(missing):
        return f"record {' and '.join(missing)}, too, and export all three columns"
    among = f" (of {', '.join(map(repr, left))})"
    return f"name {' and '.join(missing)}{among}: {look_command(path, options)}"


_AXIS = re.compile(r"(?<![A-Za-z])[xyzXYZ](?![a-z])|(?<=[a-z])[XYZ]$|\d+")


def _axes(name: str) -> list[str]:
    """Return the axis, and the number, that a column's name says, as the X of ``XForce``."""
    return [one.lower() for one in _AXIS.findall(name)]


def _first_abreast(path: Path, sheet: Sheet) -> str:
    """Return how the first of trials side by side is read; nothing where their columns have the same names."""
    first = {quantity: next(c for c in sheet.columns if may_be(c, quantity)) for quantity in QUANTITIES}
    names = [c.name for c in sheet.columns]
    if any(names.count(c.name) > 1 or not c.unit for c in first.values()):
        return ""
    told = look_command(path, {quantity: f"{c.name}:{c.unit}" for quantity, c in first.items()})
    return f"keep one trial a file; the first is read by: {told}"


def _likely_unit(column: Column, quantity: Quantity) -> str:
    """Return the unit that a column is said to be in, perhaps by a sign that an encoding lost; else legfem's own."""
    if not column.unit:
        return OWN[quantity]
    if measured_by(column) == quantity:
        return column.unit
    return "u" + column.unit[1:] if column.unit[0] in "?\ufffd" and measured_by(column) is None else "UNIT"


def look_command(path: Path, options: Mapping[str, str]) -> str:
    """Return ``legfem data look`` of a file with options, as it is typed in a shell."""
    words = ["legfem data look", shlex.quote(str(path))]
    return " ".join([*words, *(f"--{key} {shlex.quote(value)}" for key, value in options.items())])

"""What a file is that holds no recording, and the command or lines that would read it."""

import json
import re
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from legfem.channels.registry import CHANNELS
from legfem.common.errors import InputError
from legfem.data.columns import ABREAST, find_column, may_be
from legfem.data.formats.labels import OWN, Quantity, names_quantity, unit_named
from legfem.data.formats.sheet import FEWEST_ROWS, NAMELESS, NOT_CALCULATED, Column, Sheet, measured_by, measures
from legfem.data.recording import QUANTITIES, channel_of
from legfem.data.stress_tables import stretch_and_stress

_MOST_IN_A_ROW = 50
"""Numbers in a row, beyond which a table of few rows is one that lies on its side."""
_BY_PLACE = ("column 1:UNIT", "column 2:UNIT", "column 3:UNIT")


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
            f"holds {len(columns[0].values)} readings of {kind.name} and no force: it goes with a recording",
            f"give in subject.toml, beside the recordings: [channels.{kind.name}] file = {json.dumps(path.name)} "
            "(or a file a trial, with {trial} for the trial's name)",
        )
    strained = next((pair for sheet in sheets if (pair := stretch_and_stress(sheet, timed=True))), None)
    if strained is not None and has["time"] and not has["displacement"] and not has["force"]:
        raise InputError(
            path,
            "columns",
            f"holds strain ('{strained[0].name}') and stress ('{strained[1].name}') over time and no force",
            "export displacement in mm and force in N, which are strain times length and stress times area",
        )
    pressures = [c for c in columns if measures(c, "pressure")]
    if pressures and has["time"] and has["displacement"] and not has["force"]:
        raise InputError(
            path,
            "columns",
            f"holds a pressure ('{pressures[0].name}' in {pressures[0].unit}) and no force",
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
            f"is no recording: none of its columns ({few}) is named, or has a unit, like time, displacement or force",
            f"if three of them are, name them: {look_command(path, dict.fromkeys(QUANTITIES, 'NAME:UNIT'))}",
        )


def _without_names(path: Path, sheet: Sheet) -> InputError:
    count, first = len(sheet.columns), sheet.columns[0].values
    if len(first) < FEWEST_ROWS and count > _MOST_IN_A_ROW:
        return InputError(
            path,
            "columns",
            f"its numbers stand in rows of {count}, not in columns",
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

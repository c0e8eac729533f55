"""Reading a recording: which columns are time, displacement and force, in which units and directions."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from legfem.common.errors import InputError
from legfem.data.columns import find_column
from legfem.data.formats import read_sheets
from legfem.data.formats.labels import Quantity
from legfem.data.formats.sheet import FEWEST_ROWS, Sheet
from legfem.data.recording import QUANTITIES, Recording, SourceColumn, SourceColumns, read_own_table, recording_of
from legfem.data.remedies import look_command, refuse_other_table, remedy_for
from legfem.data.stress_tables import refuse_untimed, stretch_and_stress

# How sure the force has to follow the displacement for their directions to be told.
_LEAST_CORRELATION = 0.6


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
            f"{len(usable)} tables hold recordings: {names}",
            f"keep one trial a file, or name one: {look_command(path, {'sheet': usable[0][0].name})}",
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
        raise InputError(path, "rows", f"{len(d)} samples are no whole press", f"record at least {FEWEST_ROWS}")
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
            f"it doesn't follow the displacement (correlation {together:.2f}), so that directions can't be told",
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
    if found.displacement.sign < 0 or found.force.sign < 0 or not stated:
        return None
    return recording_of(path, sheets, found)


def _seen(path: Path) -> str:
    """Return as what `legfem.data look` reads a file's columns; empty where it doesn't."""
    try:
        found = propose(path, read_sheets(path)).channels
    except InputError:
        return ""
    return ", ".join(f"{q} from '{getattr(found, q).column}' in {getattr(found, q).unit}" for q in QUANTITIES)

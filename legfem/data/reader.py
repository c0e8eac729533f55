"""Reading a recording: an own table, an instrument's file, or a table that says clearly which columns are which.

Of files that an instrument is still writing into a folder, what is to be seen of each at a look (`looked`): a file is
complete once it has stood still for a while and can be read. One that stands still for longer and can't be is stalled:
the instrument may have stopped, or writes what legfem doesn't read.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from legfem.channels.kinds import IN_COLUMNS
from legfem.common.errors import InputError, Remedy
from legfem.data import recording
from legfem.data.columns import find_column, look_command, propose
from legfem.data.formats import READERS, read_sheets
from legfem.data.formats.labels import Quantity
from legfem.data.formats.sheet import Column, file_of
from legfem.data.formats.text import read_text
from legfem.data.formats.times import BY_RATE


def read_samples(
    path: Path, channels: recording.SourceColumns | None = None, area: float | None = None
) -> recording.Recording:
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
        return recording.recording_of(path, read_sheets(path), channels, area)
    if (_breaks_off(path) or file_of(path) != path) and (found := _other_dialect(path, area)) is not None:
        return found
    try:
        return recording.read_plain_table(path, area)
    except InputError as error:
        if not path.is_file() or error.field == "rows":
            raise
        found = _other_dialect(path, area)
        if found is not None:
            return found
        if error.field == "header" and area is None and (seen := _seen(path)):
            remedy = Remedy(f"{error.remedy}; or run ", look_command(path, {}), f", whose recordings.toml reads {seen}")
            raise InputError(path, error.field, error.problem, remedy) from None
        raise


def trials_in(
    files: Sequence[Path], channels: recording.SourceColumns | None = None, named: Mapping[Quantity, str] | None = None
) -> list[Path]:
    """Return files, and in place of one that has a trial in each of several tables a path a trial (`file_of`).

    Parameters
    ----------
    files
        Of recordings.
    channels
        Where they hold the quantities; a table that it names is the only one.
    named
        Columns that a user named, by their quantity.
    """
    if channels is not None and channels.sheet is not None:
        return list(files)
    if channels is not None:
        named = {q: f"{one.column}:{one.unit}" for q in recording.QUANTITIES if (one := getattr(channels, q))}
    found: list[Path] = []
    for path in files:
        tables = []
        with suppress(InputError):  # what reads a file says why it can't be
            for sheet in [] if READERS.get(path.suffix.lower(), read_text) is read_text else read_sheets(path):
                with suppress(InputError):
                    if all(find_column(path, sheet, q, (named or {}).get(q)) for q in recording.QUANTITIES):
                        tables.append(path / sheet.name)
        found += tables if len(tables) > 1 else [path]
    return found


def _breaks_off(path: Path) -> bool:
    """Tell whether a file doesn't end where a line does: its last number may be cut."""
    if not path.is_file() or path.stat().st_size == 0:
        return False
    with path.open("rb") as file:
        file.seek(-1, 2)
        return file.read(1) not in b"\r\n"


def _other_dialect(path: Path, area: float | None) -> recording.Recording | None:
    """Return what a table of another dialect than legfem's own CSV holds; None where that isn't said clearly.

    Clear are columns by name and unit, which grow as the test presses: nothing of them is guessed.
    """
    try:
        sheets = read_sheets(path)
        if any(_nearly_a_channel(column) for sheet in sheets for column in sheet.columns):
            return None
        if area is not None:
            columns = {c.name: c for c in sheets[0].columns}
            unit = columns["pressure"].unit if "pressure" in columns else None
            pressing = replace(recording.PLAIN_COLUMNS, force=recording.SourceColumn("pressure", unit or ""))
            return recording.recording_of(path, sheets, pressing, area)
        found = propose(path, sheets).channels
    except InputError:
        return None
    stated = all(c.unit for sheet in sheets for c in sheet.columns if c.name == found.time.column)
    counted = any(BY_RATE in remark for sheet in sheets for remark in sheet.remarks)
    if found.displacement.sign < 0 or found.force.sign < 0 or not stated or counted:
        return None
    return recording.recording_of(path, sheets, found)


def _nearly_a_channel(column: Column) -> bool:
    """Tell whether a column's name is nearly a channel's, or its unit isn't: left out, it would be missed."""
    words = {*column.name.lower().replace(" ", "_").split("_")}
    return recording.channel_of(column) is None and any(len(words & {*kind.name.split("_")}) > 1 for kind in IN_COLUMNS)


def _seen(path: Path) -> str:
    """Return as what `legfem.data look` reads a file's columns; empty where it doesn't."""
    try:
        found = propose(path, read_sheets(path)).channels
    except InputError:
        return ""
    return ", ".join(f"{q} from '{getattr(found, q).column}' in {getattr(found, q).unit}" for q in recording.QUANTITIES)


SETTLED_S, STALLED_S = 2.0, 10.0
"""That a file stands still before it is taken for complete, and before it is said that it can't be read."""

type Stamp = tuple[int, int]
"""Size in bytes, and time of the last change in ns."""
type Watched = Mapping[Path, WatchedFile]
type FileState = Literal["appeared", "growing", "complete", "stalled", "replaced", "gone"]
"""What a file is at a look; it is replaced where it was complete, and is written again."""


@dataclass(frozen=True)
class WatchedFile:
    """A file at a look."""

    state: FileState
    stamp: Stamp
    since: float
    """Time (s) at which it was first seen like that."""
    trouble: str = ""
    """Why it can't be read, of one that stalled."""

    @property
    def open(self) -> bool:
        """Whether it may be being written."""
        return self.state in ("appeared", "growing", "replaced")


def stamps_of(files: Iterable[Path]) -> dict[Path, Stamp]:
    """Return the stamps of the files that are there."""
    found = {}
    for path in files:
        with suppress(FileNotFoundError):
            seen = file_of(path).stat()
            found[path] = seen.st_size, seen.st_mtime_ns
    return found


def is_cut(path: Path) -> bool:
    """Tell whether a text file ends within a row: one that has no end, and fewer cells than the row before."""
    if READERS.get(path.suffix.lower()) is not read_text:
        return False
    before, last = [b"", b"", *path.read_bytes()[-_LAST_BYTES:].splitlines(keepends=True)][-2:]
    cells = (last.count(mark) < before.count(mark) for mark in (b",", b";", b"\t"))
    return not last.endswith((b"\r", b"\n")) and any(cells)


_LAST_BYTES = 4000
"""That hold a file's last two rows."""


def looked(before: Watched, there: Mapping[Path, Stamp], now: float, read: Callable[[Path], object]) -> Watched:
    """Return what the files are now; one that is gone is told of once.

    Parameters
    ----------
    before
        What they were at the last look.
    there
        Their stamps.
    now
        Time, s.
    read
        Reads a file, or raises an InputError or OSError.
    """
    left = {path: was for path, was in before.items() if path not in there and was.state != "gone"}
    gone = {path: replace(was, state="gone", since=now) for path, was in left.items()}
    return {path: _state_of(path, stamp, before.get(path), now, read) for path, stamp in there.items()} | gone


def _state_of(
    path: Path, stamp: Stamp, was: WatchedFile | None, now: float, read: Callable[[Path], object]
) -> WatchedFile:
    if was is None or was.state == "gone":
        return WatchedFile("appeared", stamp, now)
    if stamp != was.stamp:
        return WatchedFile("replaced" if was.state in ("complete", "replaced") else "growing", stamp, now)
    if not was.open or now - was.since < SETTLED_S:
        return was
    try:
        read(path)
    except (InputError, OSError) as error:
        stalled = now - was.since >= STALLED_S
        return replace(was, state="stalled", trouble=str(error)) if stalled else was
    return replace(was, state="complete")


def changes(before: Watched, now: Watched) -> dict[Path, FileState]:
    """Return the new states of the files that are in another one than at the last look."""
    return {path: one.state for path, one in now.items() if path not in before or before[path].state != one.state}

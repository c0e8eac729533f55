"""One trial as it was recorded: read from named columns of a file or from legfem's own CSV, and written as that."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from legfem.channels.kind import ChannelAccuracy, ChannelKind
from legfem.channels.kinds import CHANNELS, IN_COLUMNS
from legfem.common.drawing import Pictured, svg
from legfem.common.errors import InputError
from legfem.common.input_files import read_table
from legfem.common.units import MPA_PER_KPA, MPA_PER_MMHG, FloatArray, freeze
from legfem.data.formats.labels import UNIT_OF, Quantity, unit_named
from legfem.data.formats.sheet import Column, Sheet, trial_of
from legfem.data.smoothing import between_steps


@dataclass(frozen=True, eq=False)
class RecordedChannel:
    """What one channel read in a trial.

    Parameters
    ----------
    name : str
        Name of its kind in `CHANNELS`.
    time : (k,) array
        s, on the recording's clock, increasing at each place; read-only.
    values : (k,) array
        In the kind's unit; read-only.
    accuracy : ChannelAccuracy
        Accuracy of the instrument.
    source : Path, optional
        File of its own; a column of the recording without it.
    course : (k,) int array
        Number of the place of each reading; all zero of a channel that has no places.
    places
        At which it was read, the same in all trials of a site.
    left_out
        How many readings of its file aren't among these, by the reason: ``limit``, ``lost``, ``threshold``.
    """

    name: str
    time: FloatArray
    values: FloatArray
    accuracy: ChannelAccuracy
    source: Path | None = None
    course: NDArray[np.int_] | None = None
    places: tuple[tuple[float, ...], ...] = ()
    left_out: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Keep read-only copies; raise ValueError if the arrays' shapes differ."""
        freeze(self, "time", "values")
        if not (self.time.ndim == 1 and self.time.shape == self.values.shape):
            raise ValueError("time and values must be (k,) arrays of one length")

    @property
    def place(self) -> FloatArray:
        """Place of each reading (k, q); q = 0 for a channel that has no places."""
        return np.zeros((len(self.time), 0)) if self.course is None else np.array(self.places)[self.course]

    def at_each_place(self) -> "Iterator[tuple[int, RecordedChannel]]":
        """Yield the number of every place and what was read there; of a channel without places 0 and itself."""
        if self.course is None:
            yield 0, self
            return
        for number in np.unique(self.course):
            mine = self.course == number
            yield int(number), replace(self, time=self.time[mine], values=self.values[mine], course=None, places=())

    @property
    def kind(self) -> ChannelKind:
        """What it is."""
        return CHANNELS[self.name]


@dataclass(frozen=True, eq=False, repr=False)
class Recording(Pictured):
    """One trial, untouched.

    Parameters
    ----------
    time : (n,) array
        s, strictly increasing; read-only.
    displacement : (n,) array
        mm, growing towards the leg, of a coarse counter between its steps; read-only.
    force : (n,) array
        N, positive in compression; read-only.
    trial : str
        Name of the trial (the file's stem).
    source : Path or None
        File it was read from.
    channels : tuple of RecordedChannel
        What else was recorded.
    timed : bool
        Whether a clock gave the time; that of a table of stretch and stress counts its way.
    pulled : bool
        Whether its columns are called a pull's.
    torn : bool
        Whether the specimen tore at its end: what the file has after that is left out.
    hysteresis : float
        Share of the loading's work that a table's return, which is left out, doesn't give back; NaN without one.
    step : float
        mm, of a coarse counter's steps; 0 of any other.
    sizes : mapping
        The specimen's, as the file's heading states them (`legfem.data.formats.sheet.Sheet`).
    """

    time: FloatArray
    displacement: FloatArray
    force: FloatArray
    trial: str
    source: Path | None = None
    channels: tuple[RecordedChannel, ...] = ()
    timed: bool = True
    pulled: bool = False
    torn: bool = False
    hysteresis: float = math.nan
    step: float = 0.0
    sizes: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Keep read-only copies; raise ValueError if the arrays' shapes differ."""
        freeze(self, "time", "displacement", "force")
        if not (self.time.ndim == 1 and self.time.shape == self.displacement.shape == self.force.shape):
            raise ValueError("time, displacement and force must be (n,) arrays of one length")

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.time)

    def part(self, samples: slice | NDArray[np.bool_]) -> "Recording":
        """Return some of its samples, and all of its other channels."""
        return replace(self, **{name: getattr(self, name)[samples] for name in ("time", "displacement", "force")})

    def told(self) -> str:
        """Name, samples, and greatest readings."""
        depth, force = (given.max(initial=0.0) for given in (self.displacement, self.force))
        return f"{self.trial}, {len(self)} samples: force to {force:.3g} N by displacement to {depth:.3g} mm"

    def pictures(self) -> str:
        """Its force by its displacement; nothing of an empty one."""
        return svg([np.column_stack([self.displacement, self.force])], self.told()) if len(self) else ""


MOST = 1e9
"""Largest reading in s, mm or N: beyond it a file is misread or damaged."""


_A_DATE = 1e8
"""s: no trial begins three years after its clock was set; clocks that count from 1904 or 1970 read more."""


def check_increasing(
    path: Path, time: FloatArray, column: str, remedy: str = "sort the rows by time", lines: Sequence[int] | None = None
) -> None:
    """Check that times (n,) increase, in s.

    Parameters
    ----------
    path, column, remedy
        What errors name as the file, the times' column, and what to do.
    lines
        Lines of the file in which the rows stand, where it is known.

    Raises
    ------
    InputError
        If one of them isn't after the one before.
    """
    rows = np.flatnonzero(np.diff(time) <= 0) + 1
    if len(rows):
        row = int(rows[0])
        word = "repeats" if time[row] == time[row - 1] else "runs backwards"
        problem = f"time {word} ({time[row - 1]:g} s, then {time[row]:g} s; {len(rows)} such rows)"
        where = f"row {row + 1} of {len(time)}" if lines is None else f"line {lines[row]}"
        raise InputError(path, f"{column}, {where}", problem, remedy)


QUANTITIES: tuple[Quantity, ...] = ("time", "displacement", "force")


@dataclass(frozen=True)
class SourceColumn:
    """Where a quantity is found, and how it becomes legfem's: s, mm and N."""

    column: str
    unit: str
    sign: int = 1
    """-1 where displacement falls as the indenter goes towards the leg, or compression is
    negative."""


@dataclass(frozen=True)
class SourceColumns:
    """Where a recording's three quantities are found."""

    time: SourceColumn
    displacement: SourceColumn
    force: SourceColumn
    sheet: str | None = None
    """Sheet of a workbook or group of a file, where there are several."""


def recording_of(path: Path, sheets: Sequence[Sheet], channels: SourceColumns, area: float | None = None) -> Recording:
    """Return the recording in a file's tables.

    With an area (mm2) the force's channel is of a pressure on it.

    Raises
    ------
    InputError
        If a sheet, column or unit isn't there, or time doesn't increase.
    """
    named = [one for one in sheets if one.name == channels.sheet]
    if channels.sheet is None and len(sheets) == 1:
        named = [*sheets]
    if len(named) != 1:
        names = ", ".join(f"'{one.name}'" for one in sheets)
        problem = f"there is not exactly one table {channels.sheet!r}"
        raise InputError(path, "recordings.sheet", problem, f"name of {names}")
    sheet = named[0]
    values = [_converted(path, sheet, q, getattr(channels, q), area) for q in QUANTITIES]
    remedy = "save each trial in a file of its own, and record time with more digits"
    time, displacement, force, step = _readings(path, values, f"'{channels.time.column}'", remedy)
    used = {c.name for q in QUANTITIES for c in sheet.named(getattr(channels, q).column)}
    further = [column for column in sheet.columns if column.name not in used]
    seen = {kind.name: column for column in reversed(further) if (kind := channel_of(column))}
    read = [
        RecordedChannel(kind.name, time, seen[kind.name].factor * seen[kind.name].values[-len(time) :], kind.usual)
        for kind in IN_COLUMNS
        if kind.name in seen
    ]
    found = Recording(time, displacement, force, trial_of(path), path, tuple(read))
    pulled = any(_OF_PULLS.search(getattr(channels, q).column) for q in QUANTITIES)
    return replace(found, pulled=pulled, step=step, sizes=sheet.sizes)


_OF_PULLS = re.compile(r"tensile|(?<!ex)tension|\bzug|traction|tracción|trazione", re.IGNORECASE)


def _converted(path: Path, sheet: Sheet, quantity: Quantity, channel: SourceColumn, area: float | None) -> FloatArray:
    unit = unit_named(channel.unit)
    refused = partial(InputError, path, f"recordings.{quantity}.unit")
    measured: Quantity = "pressure" if quantity == "force" and area is not None else quantity
    if unit is None or unit.quantity != measured:
        remedy = f"give {UNIT_OF[measured]} or a multiple of it"
        raise refused(f"'{channel.unit}' is not a unit of {measured}", remedy)
    columns = sheet.named(channel.column)
    # Of two that are called alike one is in volts, perhaps, or both are one signal.
    columns = [c for c in columns if c.known_unit == unit] or columns
    if len(columns) != 1 and not (columns and all(np.array_equal(c.values, columns[0].values) for c in columns)):
        names = ", ".join(f"'{c.name}'" for c in sheet.columns)
        many = f"{len(columns)} columns" if columns else "there is no column"
        raise InputError(path, f"recordings.{quantity}.column", f"{many} '{channel.column}'", f"give one of {names}")
    if columns[0].known_unit not in (None, unit):
        problem = f"'{channel.unit}', but the file says '{columns[0].unit}'"
        raise refused(problem, "give the file's unit, or correct the file")
    size = area if measured == "pressure" and area is not None else 1.0
    return columns[0].values * size * unit.factor * channel.sign


def _readings(
    path: Path, values: Sequence[FloatArray], column: str, remedy: str, lines: Sequence[int] | None = None
) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Return time since a trial's start, displacement, force and steps that may be a test's; see `check_increasing`."""
    given = values[0]
    # Some programs write the first sample twice; later ones are no such thing.
    first = int(len(given) > 2 and given[0] == given[1] and (np.diff(given[1:]) > 0).all())
    time, displacement, force = (one[first:] for one in values)
    if len(time) > _FEW and all(np.isclose(one[-1], one[:-1].sum(), _SUMMED) for one in (time, displacement, force)):
        raise InputError(path, "rows", "the last is the sum of those above it", "remove it")
    time = time - time[0] if len(time) and _A_DATE < time[0] < np.inf else time
    _check_sizes(path, time, displacement, force)
    check_increasing(path, time, column, remedy, lines if lines is None else lines[first:])
    displacement, step = between_steps(time, displacement)
    return time, displacement, force, step


_CODES = (999.0, 9999.0, 99999.0, 999.25, 999.99, 9999.99, 32767.0, 32768.0, 65535.0)
"""What instruments and data bases write where there is no reading, of either sign."""
_FAR = 3.0
"""Times all other readings that a code is, at least."""


_FEW, _SUMMED = 8, 1e-3
"""Rows that are no recording; by how much a row of sums may be rounded, relative."""
_NOTHING = 1e-9
"""s or mm: less is a number that lost its exponent, and no test."""


def _check_sizes(path: Path, time: FloatArray, displacement: FloatArray, force: FloatArray) -> None:
    """Check that readings are of sizes that a test may have."""
    for name, one, what in (("time", time, "no time passes"), ("displacement", displacement, "nothing moves")):
        if len(one) and 0 < (span := float(np.ptp(one))) < _NOTHING:
            raise InputError(path, name, f"changes by {span:.2g} in all: {what}", "check its unit and its numbers")
    for one in (time, displacement, force):
        wrong = one[~(np.abs(one) < MOST)]
        if len(wrong):
            problem = f"{len(wrong)} numbers cannot be readings, such as {wrong[0]:g}"
            raise InputError(path, "rows", problem, "remove those rows, or export the file again")
        for end in {one.min(), one.max()} if len(one) else ():
            missing, rest = one == end, one[one != end]
            if abs(end) in _CODES and missing.sum() > 1 and len(rest) and abs(end) > _FAR * np.abs(rest).max():
                problem = f"{missing.sum()} readings are {end:g}, which stands for missing ones"
                raise InputError(path, "rows", problem, "remove those rows, or export the file again")


def channel_of(column: Column) -> ChannelKind | None:
    """Return the channel beside the force that a column is by its name and unit, as ``Fat thickness (cm)``; or None."""
    name = column.name.lower()
    words = ((kind, kind.name.split("_")) for kind in IN_COLUMNS)
    named = (kind for kind, all_of in words if all(w in name for w in all_of) or (kind.is_force and name == all_of[0]))
    return next((kind for kind in named if column.quantity == ("force" if kind.is_force else "displacement")), None)


HEADER = ("time_s", "displacement_mm", "force_N")


PLAIN_COLUMNS = SourceColumns(SourceColumn("time", "s"), SourceColumn("displacement", "mm"), SourceColumn("force", "N"))
"""Columns of legfem's CSV."""


def read_plain(path: Path) -> Recording | None:
    """Return what legfem's own CSV with further channels holds, whose cells may be empty; None for any other file."""
    if not _first_line(path).startswith(",".join(HEADER)) or not _channel_columns(path):
        return None
    return read_plain_table(path, None)


def read_plain_table(path: Path, area: float | None) -> Recording:
    """Read legfem's own CSV; with an area (mm2) a pressure on it in the force's place.

    Raises
    ------
    InputError
        If it is none, or time doesn't increase.
    """
    column, factor = HEADER[2], 1.0
    if area is not None:
        factors = {"kPa": MPA_PER_KPA, "mbar": 0.1 * MPA_PER_KPA, "mmHg": MPA_PER_MMHG}
        unit = next((unit for unit in factors if f"pressure_{unit}" in _first_line(path)), "kPa")
        column, factor = f"pressure_{unit}", factors[unit] * area
    further = _channel_columns(path)
    table = read_table(path, (*HEADER[:2], column, *further), sparse=tuple(further))
    own = [table[name].to_numpy(dtype=np.float64) for name in (*HEADER[:2], column)]
    remedy = "sort the rows by time, remove repeated ones, and save each trial in a file of its own"
    time, displacement, force, step = _readings(path, own, "time_s", remedy, table.index)
    channels = []
    for name, kind in further.items():
        values = table[name].to_numpy(dtype=np.float64)[-len(time) :]
        there = ~np.isnan(values)
        channels.append(RecordedChannel(kind.name, time[there], values[there], kind.usual))
    return Recording(time, displacement, factor * force, path.stem, path, tuple(channels), step=step)


def _first_line(path: Path) -> str:
    return path.read_bytes()[:4000].split(b"\n")[0].decode("utf-8-sig", "replace") if path.is_file() else ""


def _channel_columns(path: Path) -> dict[str, ChannelKind]:
    """Return the columns of further channels in a table's first line."""
    # As people write the force across: lateral_N.
    known = {name: kind for kind in IN_COLUMNS for name in (kind.column, kind.column.replace("_force_", "_"))}
    return {name: known[name] for cell in _first_line(path).split(",") if (name := cell.strip()) in known}


def write_recording(recording: Recording, path: Path) -> None:
    """Write ``time_s,displacement_mm,force_N`` and a column for each channel, to 0.1 um and 0.1 mN.

    A channel's readings stand in the rows nearest in time, several in one as their mean; its other cells are empty.
    A channel that is read at places has a file of its own.
    """
    import pandas as pd

    columns = {"time_s": recording.time, "displacement_mm": recording.displacement, "force_N": recording.force}
    for one in recording.channels:
        if one.places:
            continue
        between = 0.5 * (recording.time[1:] + recording.time[:-1])
        row = np.searchsorted(between, one.time)
        count = np.bincount(row, minlength=len(recording))
        total = np.bincount(row, one.values, minlength=len(recording))
        columns[one.kind.column] = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    pd.DataFrame(columns).round(4).to_csv(path, index=False)


Origin = Literal["measured", "reconstructed", "simulated"]

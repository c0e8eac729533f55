"""Reading channels beside the force: columns of a recording, or files of their own that ``[channels]`` names."""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from fnmatch import fnmatch
from itertools import product
from pathlib import Path, PurePath
from typing import Annotated, Any

import numpy as np
from pydantic import Field, create_model

from legfem.channels.kind import ChannelAccuracy, ChannelKind, Face, Frames, FramesFile, Read
from legfem.channels.kinds import CHANNELS, OF_FRAMES, OF_LEGS, UNITS
from legfem.common.errors import InputError
from legfem.common.input_files import FileTable, NotNegative, Positive, Text, Trouble, read_table
from legfem.common.units import FloatArray
from legfem.data.formats import file_of, read_sheets
from legfem.data.formats.frames import LaidFrames
from legfem.data.formats.labels import Quantity
from legfem.data.recording import RecordedChannel, Recording, channel_of, check_increasing
from legfem.geometry.indenter import Site

_LONGEST_HEADER = 200
_POINTS, _SENSELS = ("x_mm", "y_mm", "ux_mm", "uy_mm"), ("angle_deg", "pressure_kPa")
"""Columns of tables that programs of cameras and films export otherwise."""
TRIAL = "{trial}"
"""Stands for the trial's name in the name of a file."""
SITE = "{site}"
"""Stands for the site's name in the name of a file."""
_KEYS = ("gain_percent", "lag_s", "shift_mm", "turn_deg", "apart_mm", "each_percent", "creep_percent", "threshold_kPa")
_STATED = {key: (key.rpartition("_")[0], 100.0 if key.endswith("_percent") else 1.0) for key in _KEYS}
"""What of a channel's accuracy a key states, and how many of its unit are one."""
_OF_ANY = ("gain", "lag")
"""What of these every channel may have; the others only those that usually have it."""
_ERRORS = {
    "sd": ("reading", "a reading"),
    "bias": ("bias", "a constant error"),
    "slow": ("slow", "an error that changes slowly within a trial"),
}
"""Keys of standard deviations in a channel's unit: what of its accuracy each is, and in words."""


def _key(error: str, unit: str) -> str:
    """Return the key of an error, for a channel in a unit."""
    return error if unit == "-" else f"{error}_{unit}"


class RecordedChannelEntry(LaidFrames):
    """``[channels.NAME]``: where a channel is found, and how accurate it is; what isn't given is usual."""

    file: Text | None = None
    """Table of ``time_s`` and the channel, within the subject's folder or beside the recordings; without it, the
    channel is a column of the recordings. Of frames it may be what a camera's or a film's software exported: a file, or
    one a frame (``a-*.csv``)."""
    column: Text | None = None
    """Column of that table, where its name isn't the channel's."""
    optional: bool = False
    """Whether trials may be without such a file: these have none of the channel."""
    gain_percent: NotNegative | None = None
    """Standard deviation of the channel's scale."""
    lag_s: NotNegative | None = None
    """Standard deviation of the difference between the channel's clock and the recording's."""
    shift_mm: NotNegative | None = None
    """Standard deviation of how far an image lies beside where it is said to, in either direction, or a film along the
    face."""
    turn_deg: NotNegative | None = None
    """Standard deviation of how an image is turned against the section."""
    apart_mm: NotNegative | None = None
    """Distance over which errors of an image's readings are alike."""
    cells: Annotated[int, Field(ge=1, le=100)] | None = None
    """Greatest number of cells in which an image's points are taken together: more show smaller things."""
    each_percent: NotNegative | None = None
    """Standard deviation of the scale of each of a film's sensels by itself."""
    creep_percent: NotNegative | None = None
    """Standard deviation of what a film reads more for every tenfold of the time under load."""
    threshold_kPa: NotNegative | None = None
    """Pressure below which a film reads nothing: such readings are left out."""

    def troubles(self) -> Iterator[Trouble]:
        """Yield a file that isn't in the folder, and a column of none."""
        if self.file is not None and (PurePath(self.file).is_absolute() or ".." in PurePath(self.file).parts):
            yield "file", f"{self.file!r} leaves the folder", "name one within it"
        if self.column is not None and self.file is None:
            yield "column", "is given without a file", "name the file, or call the recording's column as usual"

    def error(self, of: str, unit: str) -> float | None:
        """Return what is stated of one of `_ERRORS`, for a channel in a unit."""
        stated: float | None = getattr(self, _key(of, unit))
        return stated

    def accuracy(self, kind: ChannelKind, source: Path) -> ChannelAccuracy:
        """Return what is stated of a kind's accuracy, and what is usual of the rest.

        Raises
        ------
        InputError
            If an error is given in another unit, or clocks that are a second apart.
        """
        usual, field = kind.usual, f"channels.{kind.name}"
        for name, other in product(_ERRORS, UNITS):
            if other != kind.unit and self.error(name, other) is not None:
                given_in = "has no unit" if kind.unit == "-" else f"is in {kind.unit}"
                remedy = f"give {_key(name, kind.unit)}"
                raise InputError(source, f"{field}.{_key(name, other)}", f"the channel {given_in}", remedy)
        if self.lag_s is not None and self.lag_s >= LONGEST_LAG_S:
            problem = f"clocks that may be {self.lag_s:g} s apart do not say where the cylinder was"
            remedy = "record both on one clock, or tap the cylinder and find that moment in both"
            raise InputError(source, f"{field}.lag_s", problem, remedy)
        if self.cells is not None and not kind.image:
            raise InputError(source, f"{field}.cells", "the channel is no image", "leave it out")
        given = {of: self.error(name, kind.unit) for name, (of, _) in _ERRORS.items()}
        for key, (of, unit) in _STATED.items():
            stated = getattr(self, key)
            if stated is not None and of not in _OF_ANY and not getattr(usual, of):
                raise InputError(source, f"{field}.{key}", f"the channel has no such {of}", "leave it out")
            given[of] = None if stated is None else stated / unit
        return replace(usual, **{name: value for name, value in given.items() if value is not None})


def _field(error: str, unit: str) -> Any:
    """Return the type and description of an error's key."""
    of = "without a unit" if unit == "-" else f"in {unit}"
    said = f"Standard deviation of {_ERRORS[error][1]}, for a channel {of}."
    return ((Positive if error == "sd" else NotNegative) | None, Field(None, description=said))


_BY_UNIT = {_key(error, unit): _field(error, unit) for error, unit in product(_ERRORS, UNITS)}
_ENTRY = create_model("ChannelEntry", __base__=RecordedChannelEntry, __module__=__name__, **_BY_UNIT)
"""With the errors of channels of every unit."""


def _channels(title: str, names: Iterable[str]) -> type[FileTable]:
    fields: dict[str, Any] = dict.fromkeys(names, (_ENTRY | None, None))
    made = create_model(title, __base__=FileTable, __module__=__name__, **fields)
    made.alternatives = tuple(fields)
    return made


_OF_LEGS_FRAMES = (entry for entry, file in OF_FRAMES.items() if not {*file.kinds}.isdisjoint(OF_LEGS))
ChannelsEntry = _channels("ChannelsEntry", (*(kind.name for kind in OF_LEGS), *_OF_LEGS_FRAMES))
"""Channel entries of a leg's file."""
SpecimenChannelsEntry = _channels(
    "SpecimenChannelsEntry", (kind.name for kind in CHANNELS.values() if "specimen" in kind.models)
)
"""Channel entries of a specimen's file."""

LONGEST_LAG_S = 1.0
"""Lag of a channel's clock from which on it is refused."""


def with_channels(
    toml: Path,
    given: FileTable,
    recordings: Sequence[Recording],
    site: Site | Sequence[Face] | None = None,
    name: str = "",
) -> tuple[Recording, ...]:
    """Return recordings with the channels that a subject's file names, and the accuracy that it states.

    Parameters
    ----------
    toml
        The subject's file.
    given
        Its ``[channels]``.
    recordings
        Recordings of one site.
    site
        Where the leg is pressed, or the specimens' faces, one a recording; None of what has no frames.
    name
        Name of the site, where a leg has several.

    Raises
    ------
    InputError
        If a channel's file or column isn't there or can't be read.
    """
    entries: dict[str, RecordedChannelEntry] = {name: entry for name, entry in given if entry is not None}
    for key, entry in entries.items():
        frames = OF_FRAMES.get(key)
        if not frames:
            entry.ask(toml, {})
        accuracy = None if frames else entry.accuracy(CHANNELS[key], toml)
        if not recordings or (frames and site is None):
            continue
        if frames and (entry.file is None or entry.column is not None):
            remedy = f"give file, of {','.join(('time_s', *frames.columns))}"
            raise InputError(toml, f"channels.{key}", "frames have a file of their own", remedy)
        if entry.file is None and accuracy is not None:
            if not any(channel.name == key for one in recordings for channel in one.channels):
                problem = f"no recording has a column {CHANNELS[key].column}"
                remedy = "add it, its cells empty where nothing was read, or name a file"
                raise InputError(toml, f"channels.{key}", problem, remedy)
            stated = [
                [replace(c, accuracy=accuracy) if c.name == key else c for c in one.channels] for one in recordings
            ]
            recordings = [replace(one, channels=tuple(c)) for one, c in zip(recordings, stated, strict=True)]
            continue
        recordings = _with_files(toml, key, entry, recordings, site, name)
    return tuple(recordings)


def _with_files(
    toml: Path,
    key: str,
    entry: RecordedChannelEntry,
    recordings: Sequence[Recording],
    site: Site | Sequence[Face] | None,
    name: str,
) -> list[Recording]:
    """Return recordings with the channels of an entry's files; see `with_channels`."""
    every = dict(enumerate(_channel_file(toml, entry, one, len(recordings), key, name) for one in recordings))
    paths = {k: path for k, path in every.items() if files_named(path)} or every
    lacking = next((k for k in every if k not in paths), None)
    if lacking is not None and not entry.optional:
        problem = f"trial {recordings[lacking].trial} has none: there is no {every[lacking].name}"
        raise InputError(toml, f"channels.{key}.file", problem, "add it, or optional = true if some trials have none")
    if key in OF_FRAMES and site is not None:
        file, faces = OF_FRAMES[key], site if isinstance(site, Site) else [site[k] for k in paths]
        frames = [_frames(path, file, faces, entry, recordings[k]) for k, path in paths.items()]
        try:
            each = zip(file.of_frames(frames, faces), frames, strict=True)
        except InputError as error:
            raise error.at(next(iter(paths.values()))) from None
        read = [[replace(one, left_out=own.left_out) for one in found] for found, own in each]
    else:
        read = [[Read(key, *read_channel(path, CHANNELS[key], entry.column))] for path in paths.values()]
    found = {k: _with_read(toml, paths[k], entry, one, recordings[k]) for k, one in zip(paths, read, strict=True)}
    return [found.get(k, one) for k, one in enumerate(recordings)]


def _channel_file(
    toml: Path, entry: RecordedChannelEntry, recording: Recording, trials: int, name: str, site: str
) -> Path:
    """Return the file of an entry for one of a number of trials: within the folder, or beside the recording.

    Raises
    ------
    InputError
        If several trials have one file.
    """
    assert entry.file is not None
    if trials > 1 and TRIAL not in entry.file:
        remedy = f"give one a trial, and write {TRIAL} for the trial's name, as in us-{TRIAL}.csv"
        raise InputError(toml, f"channels.{name}.file", f"'{entry.file}' is one file for {trials} trials", remedy)
    path = toml.parent / entry.file.replace(SITE, site).replace(TRIAL, recording.trial)
    nearby = None if recording.source is None else file_of(recording.source).parent / path.name
    return nearby if nearby is not None and files_named(nearby) and not files_named(path) else path


def files_named(path: Path) -> list[Path]:
    """Return the files that a path names; with ``*`` in its name, of those that there are."""
    found = path.parent.glob(path.name) if "*" in path.name else [path]
    return sorted(one for one in found if one.is_file())


def is_channel_file(path: Path, given: FileTable, site: str = "") -> bool:
    """Return whether a file among recordings is one that ``[channels]`` names, and so no recording."""
    names = (entry.file for _, entry in given if entry is not None and entry.file is not None)
    return any(fnmatch(path.name, PurePath(name.replace(SITE, site).replace(TRIAL, "*")).name) for name in names)


def frames_in(path: Path) -> list[FramesFile[Any]]:
    """Return what may read a table of frames, by its header; nothing of other files."""
    return [one for one in OF_FRAMES.values() if _header(path) == ("time_s", *one.columns)]


def _header(path: Path) -> tuple[str, ...]:
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        return tuple(name.strip() for name in re.split("[,;\t]", file.readline(_LONGEST_HEADER)))


def _frames(
    path: Path, file: FramesFile[Any], site: Site | Sequence[Face], entry: RecordedChannelEntry, recording: Recording
) -> Frames:
    """Return a trial's frames in time: of legfem's own table, or one that a camera's or a film's software exported."""
    files = files_named(path)
    foreign = bool(files) and _header(files[0])[0] != "time_s"
    if foreign and file.columns == _POINTS:
        from legfem.data.formats.points import read_points

        table = read_points(files, entry)
    elif foreign and file.columns == _SENSELS and isinstance(site, Site):
        from legfem.data.formats.films import read_film

        table = read_film(files, entry, site.indenter)
    else:
        table = read_table(path, ("time_s", *file.columns)).to_numpy(dtype=np.float64)
        entry.ask(path, {})
    table = table[np.argsort(table[:, 0], kind="stable")]
    left_out = {"limit": int(np.isinf(table[:, -1]).sum()), "lost": int(np.isnan(table[:, -1]).sum())}
    table = table[np.isfinite(table[:, -1])]
    return Frames(table[:, 0], table[:, 1:], recording.time, recording.force, left_out, entry.cells)


def _with_read(
    toml: Path, path: Path, entry: RecordedChannelEntry, found: Sequence[Read], recording: Recording
) -> Recording:
    """Return a recording with the channels that a file gives, without what is below an instrument's threshold."""
    taken = {one.name for one in recording.channels} & {one.name for one in found}
    if taken:
        raise InputError(path, "channels", f"{', '.join(taken)} is given already", "keep one of the two")
    channels = []
    for one in found:
        kind = CHANNELS[one.name]
        accuracy = entry.accuracy(kind, toml)
        least = accuracy.threshold
        told = np.ones(len(one.values), dtype=bool) if least is None else one.values >= least
        if not told.any():
            problem = f"no reading reaches {least:g} {kind.unit}"
            raise InputError(path, one.name, problem, "give a lower threshold, or leave the file out")
        course = None if one.course is None else one.course[told]
        read = one.time[told], one.values[told], accuracy, path, course, one.places
        channels.append(RecordedChannel(one.name, *read, {**one.left_out, "threshold": int((~told).sum())}))
    return replace(recording, channels=(*recording.channels, *channels))


def read_channel(path: Path, kind: ChannelKind, column: str | None = None) -> tuple[FloatArray, FloatArray]:
    """Read a channel's file.

    Parameters
    ----------
    path
        A table of ``time_s`` and the channel's column, of few rows or many; or an instrument's file of any kind
        that recordings may have, whose columns state their units.
    kind
        Kind of the channel.
    column
        Name of its column, where that isn't the only one of its unit.

    Returns
    -------
    time, values : (k,) array
        s, and the kind's unit.

    Raises
    ------
    InputError
        If the file can't be read, or time doesn't increase.
    """
    try:
        table = read_table(path, ("time_s", column or kind.column))
        time, values = (table[name].to_numpy(dtype=np.float64) for name in table)
    except InputError as error:
        if error.field != "header":
            raise
        time, values = _of_instrument(path, kind, column, error)
    check_increasing(path, time, "time")
    return time, values


def _of_instrument(
    path: Path, kind: ChannelKind, column: str | None, refusal: InputError
) -> tuple[FloatArray, FloatArray]:
    try:
        sheets = read_sheets(path)
    except InputError:
        raise refusal from None
    columns = [one for sheet in sheets for one in sheet.columns]
    timed = [c for c in columns if c.quantity == "time"]
    quantity: Quantity = "force" if kind.is_force else "displacement"
    able = [c for c in columns if c.quantity == quantity and c not in timed]
    named = [c for c in able if c.name == column] if column else [c for c in able if channel_of(c) == kind]
    if not column and not named:
        named = [c for c in able if channel_of(c) is None]
    if len(timed) != 1 or len(named) != 1:
        there = ", ".join(f"'{c.name}' in {c.unit or 'no unit'}" for c in columns)
        what = "time" if len(timed) != 1 else kind.name
        remedy = f"give time_s,{kind.column}, or name the column under [channels.{kind.name}]"
        raise InputError(path, what, f"none, or more than one, of the columns {there} can be it", remedy)
    return timed[0].values * timed[0].factor, named[0].values * named[0].factor

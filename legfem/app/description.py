"""The TOML file that says what a folder is: its keys for a form, changed with all else kept, or made of loose files."""

import math
import tomllib
import types
from collections.abc import Collection, Iterator, Mapping, MutableMapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin

import tomlkit
from pydantic.fields import FieldInfo
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Item

from legfem.app.workspace import files_of, is_scan, may_be_recording
from legfem.common.documents import write_atomically
from legfem.common.errors import InputError
from legfem.common.input_files import FileTable, checked
from legfem.data import seen_instrument
from legfem.data.formats import recording_files
from legfem.data.reader import read_samples
from legfem.data.recording import SourceColumns
from legfem.geometry.indenter import IndenterShape
from legfem.legs.folder import plain_id, subject_text
from legfem.legs.schema import SUBJECTS, SubjectFile, site_names, subject_entry
from legfem.specimens.schema import SIZES, SeveralTests, SpecimenFile

type Value = str | float | bool | list[float] | None


@dataclass(frozen=True)
class Setting:
    """One key of the file.

    Parameters
    ----------
    key : tuple of str
        Tables and key.
    kind : type
        Of the value: ``float``, ``str``, ``bool``, or ``list`` for a point's coordinates.
    choices : tuple of str
        What a text may be; empty for any.
    value : Value
        None where the file doesn't state it.
    default : Value
        That holds then; None where there is none.
    needed : bool
        Whether the schema asks for it.
    help : str
        What it is.
    """

    key: tuple[str, ...]
    kind: type
    choices: tuple[str, ...]
    value: Value
    default: Value
    needed: bool
    help: str = ""

    @property
    def name(self) -> str:
        """The key with its tables."""
        return ".".join(self.key)


def settings_of(schema: type[FileTable], text: str) -> list[Setting]:
    """Return the keys of numbers and texts that a schema knows, in its order.

    Tables in arrays and names of files' columns are left to others; of tables that are alternatives
    those that are given are there.

    Raises
    ------
    InputError
        If the text is no TOML.
    """
    given = _parsed(text)
    if schema is SpecimenFile and "tests" in given:
        schema = SeveralTests
    return list(_settings(schema, given, ()))


def with_settings(text: str, changed: Mapping[tuple[str, ...], Value]) -> str:
    """Return the file's text with values changed, or taken out where they are None.

    Comments, order and all else stay as they were.
    """
    document = _parsed(text)
    for key, value in changed.items():
        table: MutableMapping[str, Any] = document
        for name in key[:-1]:
            if name not in table:
                if value is None:
                    break
                table[name] = tomlkit.table()
            table = table[name]
        else:
            if value is None:
                table.pop(key[-1], None)
            else:
                table[key[-1]] = value
    return tomlkit.dumps(document)


def with_channels(text: str, channels: SourceColumns | None) -> str:
    """Return the file's text with the columns of its recordings, or without any."""
    keys: dict[tuple[str, ...], Value] = {}
    names = ("time", "displacement", "force")
    if channels is None:
        keys |= {("recordings", name): None for name in (*names, "sheet")}
        return with_settings(text, keys)
    keys["recordings", "sheet"] = channels.sheet
    for name in names:
        channel = getattr(channels, name)
        keys["recordings", name, "column"] = channel.column
        keys["recordings", name, "unit"] = channel.unit
        if name != "time":
            keys["recordings", name, "sign"] = channel.sign
    return with_settings(text, keys)


def _parsed(text: str) -> tomlkit.TOMLDocument:
    try:
        return tomlkit.parse(text)
    except TOMLKitError as error:
        raise InputError("TOML", "syntax", str(error), "correct it in the file's text") from None


def _settings(schema: type[FileTable], given: Mapping[str, Any], above: tuple[str, ...]) -> Iterator[Setting]:
    for name, field in schema.model_fields.items():
        found = given.get(name)
        plain, choices = _plain(field.annotation)
        key = (*above, name)
        if isinstance(plain, type) and issubclass(plain, FileTable):
            if name in _COLUMNS or (found is None and name in schema.alternatives):
                continue
            table = found if isinstance(found, Mapping) else None
            needed = table is not None or type(None) not in get_args(field.annotation)
            for one in _settings(plain, table or {}, key):
                yield replace(one, needed=one.needed and needed)
        elif plain in (float, str, bool, list):
            default = None if field.is_required() else field.get_default()
            unwrapped = found.unwrap() if isinstance(found, Item) else found
            yield Setting(key, plain, choices, unwrapped, default, field.is_required(), _help(field))


_COLUMNS = ("time", "displacement", "force")


def _plain(annotation: Any) -> tuple[Any, tuple[str, ...]]:
    """Return the type of a key's value and what it may be; None for types that no form has."""
    if get_origin(annotation) in (Union, types.UnionType):
        parts = [part for part in get_args(annotation) if part is not type(None)]
        return _plain(parts[0]) if len(parts) == 1 else (None, ())
    if hasattr(annotation, "__metadata__"):
        return _plain(get_args(annotation)[0])
    if get_origin(annotation) is Literal:
        choices = get_args(annotation)
        return (str, choices) if all(isinstance(one, str) for one in choices) else (None, ())
    if get_origin(annotation) is list:
        inner, _ = _plain(get_args(annotation)[0])
        return (list, ()) if inner is float else (None, ())
    return annotation, ()


def _help(field: FieldInfo) -> str:
    return " ".join((field.description or "").replace("``", "").split())


def read_value(setting: Setting, text: str) -> Value:
    """Return what a user typed for a setting; None for nothing.

    Raises
    ------
    InputError
        If it is not a number where one is asked for.
    """
    text = text.strip()
    if not text:
        return None
    if setting.kind is str:
        return text
    parts = text.split(",") if setting.kind is list else [text]
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = [math.nan]
    if not all(math.isfinite(number) for number in numbers):
        raise InputError(
            setting.name,
            "value",
            f"{text!r} is not a number",
            "write decimals with points, and coordinates with a comma between",
        )
    return numbers if setting.kind is list else numbers[0]


@dataclass(frozen=True)
class CalfSize:
    """What stands for a calf's outlines where there are none."""

    girth: float
    """Girth of the calf where it is pressed, mm."""
    fat: float
    """Thickness of skin and fat under the indenter, mm."""


@dataclass(frozen=True)
class DescribedLeg:
    """What a person has to say of a leg that was pressed; nothing else can be assumed."""

    title: str
    source: str | CalfSize
    """File in the folder (contours of the section, or a scan that it is cut from), or the size of a typical calf."""
    diameter: float
    """Of what pressed, mm."""
    length: float | None
    """Of a cylinder along its axis, mm."""
    aim: tuple[float, float] | None = None
    """A point on its line of travel, mm; of a typical calf there is none to give, ..."""
    direction: float | None = None
    """... nor a direction of travel, degrees from +x."""
    level: float | None = None
    """At which a scan is cut, mm."""
    shape: IndenterShape = "cylinder"
    axis_deg: float = 0.0
    """By which a cylinder is turned about its travel: 0 lies along the leg, 90 across it."""

    def describe(self, folder: Path) -> None:
        """Write ``subject.toml``, and move the recordings where it looks for them.

        The tissues are the first paper's until they are changed; errors of the instrument are left
        out: the commands ask for them.

        Raises
        ------
        InputError
            As the file does; nothing is written or moved then.
        """
        text = subject_text(plain_id(folder.name), self.title, "measured", 0.6, (0.0, 0.0), 0.0)
        stated: dict[tuple[str, ...], Value] = {
            **self._shape_of_leg(folder),
            ("section", "level_mm"): self.level,
            ("indenter", "aim_mm"): None if self.aim is None else list(self.aim),
            ("indenter", "direction_deg"): self.direction,
            ("indenter", "diameter_mm"): self.diameter,
            ("indenter", "length_mm"): self.length,
            ("indenter", "shape"): None if self.shape == "cylinder" else self.shape,
            ("indenter", "axis_deg"): self.axis_deg or None,
            ("instrument",): None,
        }
        path, described = folder / "subject.toml", with_settings(text, stated)
        checked(path, tomllib.loads(described), SubjectFile)
        _gather_recordings(folder, but=[self.source] if isinstance(self.source, str) else ())
        write_atomically(path, described)

    def _shape_of_leg(self, folder: Path) -> dict[tuple[str, ...], Value]:
        if isinstance(self.source, CalfSize):
            sizes: dict[tuple[str, ...], Value] = {
                ("section", "girth_mm"): self.source.girth,
                ("section", "fat_mm"): self.source.fat,
            }
            return {("section", "contours"): None, **sizes}
        scan = is_scan(folder / self.source)
        return {("section", "contours"): None, ("section", "scan" if scan else "contours"): self.source}


@dataclass(frozen=True)
class DescribedStocking:
    """What a person has to say of a leg in a stocking."""

    title: str
    bare: str
    """Scan of the bare leg: a file in the folder."""
    compressed: str
    """Scan of the leg in its stocking: a file in the folder; may be empty."""
    compression_class: str

    def describe(self, folder: Path) -> None:
        """Write ``leg.toml``."""
        text = tomlkit.document()
        text.update({"id": plain_id(folder.name), "title": self.title, "origin": "measured"})
        text["bare"] = {"scan": self.bare}
        if self.compressed:
            text["compressed"] = {"scan": self.compressed}
        text["stocking"] = {"compression_class": self.compression_class}
        write_atomically(folder / "leg.toml", tomlkit.dumps(text))


@dataclass(frozen=True)
class DescribedSpecimens:
    """What a person has to say of specimens of one size; others' sizes go into the file's text."""

    title: str
    test: str
    """A table of ``specimen.toml``: what was done to them."""
    stated: Mapping[str, Value]
    """Sizes of specimen and instrument and what sticks, by the table's keys; None is left out."""

    def describe(self, folder: Path) -> None:
        """Write ``specimen.toml``, and move the recordings where it looks for them."""
        text = tomlkit.document()
        text.update({"id": plain_id(folder.name), "title": self.title, "origin": "measured"})
        text[self.test] = {key: value for key, value in self.stated.items() if value is not None}
        _gather_recordings(folder)
        write_atomically(folder / "specimen.toml", tomlkit.dumps(text))


def _gather_recordings(folder: Path, but: Collection[str] = ()) -> None:
    """Move what may be recordings into the folder's folder of them."""
    recordings = folder / "recordings"
    for path in files_of(folder):
        inside = path.parent == folder and path.name not in but
        if inside and may_be_recording(path) and not is_contours(path):
            recordings.mkdir(exist_ok=True)
            path.rename(recordings / path.name)


def known_tests() -> dict[str, list[Setting]]:
    """Return the tests that ``specimen.toml`` can have, each with what is asked for.

    A size that several specimens could have of their own is needed: here there is one.
    """
    every: dict[str, list[Setting]] = {}
    for name in SpecimenFile.alternatives:
        found = settings_of(SpecimenFile, f"[{name}]\n")
        every[name] = [replace(one, needed=one.needed or one.key[-1] in SIZES) for one in found if one.key[0] == name]
    return every


def is_contours(path: Path) -> bool:
    """Tell whether a file holds contours of a section."""
    with path.open("rb") as file:
        return path.suffix.lower() == ".csv" and file.readline(200).startswith(b"part,")


def contours_in(folder: Path) -> list[str]:
    """Return the names of files with contours."""
    return [path.name for path in folder.glob("*.csv") if is_contours(path)]


def scans_in(folder: Path) -> list[str]:
    """Return the paths of scans within a folder."""
    return [path.relative_to(folder).as_posix() for path in files_of(folder) if is_scan(path)]


def shown_errors(folder: Path) -> tuple[float, float] | None:
    """Return the errors of force (N) and displacement (mm) that a leg's recordings show from sample to sample.

    None where the instrument is stated, or the recordings can't be read yet.
    """
    try:
        path = folder / SUBJECTS.file
        given = subject_entry(path, next(iter(site_names(path)), ""))
        if given.given.instrument is not None:
            return None
        channels = given.given.recordings.channels()
        files = recording_files(folder / given.recordings)
        read = [read_samples(one, channels) for one in files]
    except InputError:
        return None
    seen = seen_instrument(read)
    return (seen.force_sd, seen.displacement_sd) if read else None

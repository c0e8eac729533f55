"""The TOML file that says what a folder is: its keys for a form, changed with all else kept, or made of loose files."""

import math
import tomllib
import types
from collections.abc import Iterator, Mapping, MutableMapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Item

from legfem.app.workspace import files_of, is_scan
from legfem.common.documents import write_atomically
from legfem.common.errors import InputError
from legfem.common.input_files import FileTable, checked
from legfem.data import seen_instrument
from legfem.data.formats import may_be_recording, recording_files
from legfem.data.reader import read_samples, trials_in
from legfem.data.recording import QUANTITIES, SourceColumns
from legfem.geometry.section import CALF
from legfem.legs.folder import plain_id, subject_text
from legfem.legs.schema import SUBJECTS, SubjectFile, site_names, subject_entry
from legfem.legs.typical import TYPICAL_LIMBS
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
        The value's: ``float``, ``str``, ``bool``, or ``list`` for a point's coordinates.
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
    if channels is None:
        return with_settings(text, {("recordings", name): None for name in (*QUANTITIES, "sheet")})
    keys: dict[tuple[str, ...], Value] = {("recordings", "sheet"): channels.sheet}
    for name in QUANTITIES:
        for key, value in asdict(getattr(channels, name)).items():
            if (name, key) != ("time", "sign"):
                keys["recordings", name, key] = value
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
            if name in QUANTITIES or (found is None and name in schema.alternatives):
                continue
            table = found if isinstance(found, Mapping) else None
            needed = table is not None or type(None) not in get_args(field.annotation)
            for one in _settings(plain, table or {}, key):
                yield replace(one, needed=one.needed and needed)
            continue
        said = " ".join((field.description or "").replace("``", "").split())
        unwrapped = found.unwrap() if isinstance(found, Item) else found
        if plain in (float, str, bool, list):
            default = None if field.is_required() else field.get_default()
            yield Setting(key, plain, choices, unwrapped, default, field.is_required(), said)
        elif get_origin(plain) is dict:
            names, kind = map(_plain, get_args(plain))
            told = unwrapped if isinstance(unwrapped, Mapping) else {}
            for last in names[1]:
                yield Setting((*key, last), kind[0], (), told.get(last), None, False, said)


def _plain(annotation: Any) -> tuple[Any, tuple[str, ...]]:
    """Return the type of a key's value and what it may be; None for types that no form has."""
    annotation = getattr(annotation, "__value__", annotation)
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
        remedy = "write decimals with points, and coordinates with a comma between"
        raise InputError(setting.name, "value", f"{text!r} is not a number", remedy)
    return numbers if setting.kind is list else numbers[0]


def describe(
    folder: Path, file: str, stated: Mapping[tuple[str, ...], Value], channels: SourceColumns | None = None
) -> None:
    """Write the file that says what a folder is, and move the recordings where it looks for them.

    The tissues of a pressed leg are the first paper's until they are changed; errors of the instrument are left out
    where they aren't stated: the commands ask for them.

    Parameters
    ----------
    folder : Path
        Its name is the title.
    file : str
        One of `legfem.app.workspace.DESCRIPTIONS`.
    stated : mapping
        Values by tables and key; None is left out.
    channels : SourceColumns, optional
        Columns of the recordings, where they aren't legfem's own.

    Raises
    ------
    InputError
        As the file of a pressed leg does; nothing is written or moved then.
    """
    path, name = folder / file, plain_id(folder.name)
    text = tomlkit.dumps({"id": name, "title": folder.name, "origin": "measured"})
    if file == SUBJECTS.file:
        limb = TYPICAL_LIMBS[str(stated.get(("section", "limb"), CALF))]
        text = subject_text(name, folder.name, "measured", 0.0 if limb.is_pad else FASCIA_MM, (0.0, 0.0), 0.0)
        unsaid = ("section", "contours"), ("indenter", "aim_mm"), ("indenter", "direction_deg"), ("instrument",)
        stated = {**dict.fromkeys(unsaid), **stated}
    text = with_settings(text, stated)
    text = text if channels is None else with_channels(text, channels)
    if file == SUBJECTS.file:
        checked(path, tomllib.loads(text), SubjectFile)
    recordings = folder / "recordings"
    for one in files_of(folder) if file != "leg.toml" else ():
        if one.parent == folder and may_be_recording(one) and not is_contours(one):
            recordings.mkdir(exist_ok=True)
            one.rename(recordings / one.name)
    write_atomically(path, text)


FASCIA_MM = 0.6
"""Thickness of the fascia that a new description has."""


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
        files = trials_in(recording_files(folder / given.recordings), channels)
        read = [read_samples(one, channels) for one in files]
    except InputError:
        return None
    seen = seen_instrument(read)
    return (seen.force_sd, seen.displacement_sd) if read else None

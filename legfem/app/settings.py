"""What a folder's TOML file states, key by key, so that a form can show and change it."""

from __future__ import annotations

import math
import types
from collections.abc import Iterator, Mapping, MutableMapping
from dataclasses import dataclass, replace
from typing import Any, Literal, Union, get_args, get_origin

import tomlkit
from pydantic.fields import FieldInfo
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Item

from legfem.common.errors import InputError
from legfem.common.input_files import FileTable
from legfem.data.reader import Channels

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
        What it is, where its name doesn't say.
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
    the one that is given is there.

    Raises
    ------
    InputError
        If the text is no TOML.
    """
    return list(_settings(schema, _parsed(text), ()))


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


def with_channels(text: str, channels: Channels | None) -> str:
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
        If it is no number where one is asked for.
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
            f"{text!r} is no number",
            "write decimals with points, and coordinates with a comma between",
        )
    return numbers if setting.kind is list else numbers[0]

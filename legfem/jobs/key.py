"""The one key of finished work: a hash of all that it depends on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Contents:
    """Stands for what is in a file, or in all files of a folder, wherever that lies."""

    path: Path

    def digest(self) -> list[list[str]]:
        """Return names and hashes of the files; a missing one has none."""
        files = [self.path] if self.path.is_file() else sorted(self.path.rglob("*"))
        return [
            [file.relative_to(self.path).as_posix(), hashlib.sha256(file.read_bytes()).hexdigest()]
            for file in files
            if file.is_file()
        ]


def key_of(*given: object) -> str:
    """Return a hash of values: JSON's, dataclasses, arrays, `Contents` of files.

    Floats and arrays count to the last bit, dataclasses by their names and the fields that they
    are made from.

    Raises
    ------
    TypeError
        For a value of which nobody knows what it depends on. So is a path: say `Contents` of it,
        or ``str``.
    """
    text = json.dumps([_described(value) for value in given])
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def _described(value: Any) -> Any:
    """Return a value as JSON types that differ where the value does."""
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, Enum):
        return _described(value.value)
    if isinstance(value, np.generic):
        return _described(value.item())
    if isinstance(value, int):
        return value
    if isinstance(value, float):
        return value.hex()
    if isinstance(value, np.ndarray):
        data = np.ascontiguousarray(value).tobytes()
        return [value.dtype.str, list(value.shape), hashlib.sha256(data).hexdigest()]
    if isinstance(value, Contents):
        return value.digest()
    if isinstance(value, Mapping):
        entries = [[_described(name), _described(entry)] for name, entry in value.items()]
        return {"mapping": sorted(entries, key=json.dumps)}
    if isinstance(value, Set):
        return {"set": sorted((_described(entry) for entry in value), key=json.dumps)}
    if isinstance(value, Sequence) and not isinstance(value, bytes):
        return [_described(entry) for entry in value]
    if is_dataclass(value) and not isinstance(value, type):
        made_from = [field.name for field in fields(value) if field.init]
        return {type(value).__qualname__: {n: _described(getattr(value, n)) for n in made_from}}
    raise TypeError(f"no key can be made of {type(value).__qualname__}")

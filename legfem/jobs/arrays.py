"""Arrays in a file: there whole, or not at all."""

from __future__ import annotations

import io
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from legfem.common.errors import naming

type Arrays = dict[str, NDArray[Any]]


def write_arrays(path: Path, arrays: Mapping[str, NDArray[Any]], compressed: bool = False) -> None:
    """Write arrays by name (``.npz``); a reader never meets half of them."""
    content = io.BytesIO()
    save = np.savez_compressed if compressed else np.savez
    save(content, **arrays)  # type: ignore[arg-type]
    new = path.with_suffix(".new")
    try:
        with naming(path):
            new.write_bytes(content.getvalue())
            new.replace(path)
    except OSError:
        new.unlink(missing_ok=True)
        raise


def read_arrays(path: Path) -> Arrays:
    """Return a file's arrays; none where it is missing or malformed."""
    try:
        with np.load(path) as kept:
            return dict(kept)
    except (OSError, ValueError, LookupError, TypeError, EOFError, BadZipFile, zlib.error):
        return {}

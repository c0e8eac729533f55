"""Files of results, which are there whole or not at all: JSON, text, tables in Markdown."""

from __future__ import annotations

import json
import math
import os
import re
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from legfem.common.errors import naming


def write_atomically(path: Path, text: str) -> None:
    """Write a file so that no reader, and no kill, ever meets half of it."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with naming(path), os.fdopen(handle, "w") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        # mkstemp's files are private; the results needn't be.
        Path(name).chmod(0o644)
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def write_document(path: Path, content: Mapping[str, Any] | list[Any]) -> Path:
    """Write JSON, making the folder; return the path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, json.dumps(content, indent=1) + "\n")
    return path


def json_types(value: Any) -> Any:
    """Return a value as JSON types; numbers that aren't finite become null."""
    if isinstance(value, Mapping):
        return {str(key): json_types(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [json_types(entry) for entry in value]
    if isinstance(value, np.ndarray | np.generic):
        return json_types(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]], aligned: bool = False) -> str:
    """Return a table, its columns aligned if asked for; a bar within a cell becomes "or"."""
    lines = [[cell.replace("|", "or") for cell in line] for line in (header, *rows)]
    widths = [max(map(len, column)) if aligned else 0 for column in zip(*lines, strict=True)]

    def line(cells: Sequence[str]) -> str:
        return "| " + " | ".join(c.ljust(w) for c, w in zip(cells, widths, strict=True)) + " |"

    rule = "|" + "|".join("-" * max(width + 2, 3) for width in widths) + "|"
    return "\n".join([line(lines[0]), rule, *map(line, lines[1:])]) + "\n"


_FORMULA = ("=", "+", "-", "@", "\t", "\r")
_SIGNED = re.compile(r"[-+]\d[\d.,]*(e[-+]?\d+)?( [\w%./ ]*)?", re.IGNORECASE)


def literal(value: Any) -> Any:
    """Text that a spreadsheet doesn't take for a formula; numbers and what begins with one as they are."""
    if not isinstance(value, str) or not value.startswith(_FORMULA) or _SIGNED.fullmatch(value):
        return value
    return f"'{value}"

"""Files of results, which are there whole or not at all: JSON, text, tables in Markdown; and versions they state.

What stands for the content of files, wherever they lie, is made here too.
"""

import hashlib
import json
import math
import os
import platform
import re
import secrets
import subprocess
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import lru_cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from legfem.common.errors import naming
from legfem.common.units import FloatArray

# Modules that a package of another name may bring: dolfinx-solver-real has both.
_MODULES = {"fenics-dolfinx": "dolfinx", "petsc4py": "petsc4py"}

_CHECKOUT = Path(__file__).resolve().parents[2]


def package_version(name: str) -> str:
    """Return an installed package's version, or ``unknown``."""
    try:
        return version(name)
    except PackageNotFoundError:
        module = _MODULES.get(name)
    if module is None or find_spec(module) is None:
        return "unknown"
    return str(import_module(module).__version__)


def legfem_version() -> str:
    """Version of legfem's release, from its sources where it isn't installed."""
    project = _CHECKOUT / "pyproject.toml"
    if project.is_file():
        return str(tomllib.loads(project.read_text())["project"]["version"])
    return package_version("legfem")


@lru_cache
def legfem_build() -> str:
    """Version of legfem; of a checkout with its commit (``0.2.0+1a2b3c4``, ``.dirty`` where files were changed)."""
    asked = ["git", "-C", str(_CHECKOUT), "describe", "--always", "--exclude=*", "--dirty=.dirty"]
    if not (_CHECKOUT / ".git").exists():
        return legfem_version()
    try:
        commit = subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return legfem_version()
    return f"{legfem_version()}+{commit}"


def versions_of(*names: str) -> dict[str, str]:
    """Return versions of ``legfem``, ``python`` and packages, by name; ``dolfinx`` is DOLFINx."""
    known = {"legfem": legfem_build(), "python": platform.python_version()}
    packages = {"dolfinx": "fenics-dolfinx"}
    return {name: known.get(name) or package_version(packages.get(name, name)) for name in names}


def write_atomically(path: Path, content: str | bytes) -> None:
    """Write a file so that no reader, and no kill, ever meets half of it."""
    unfinished = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    try:
        with naming(path), unfinished.open("xb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())
        unfinished.replace(path)
    except BaseException:
        unfinished.unlink(missing_ok=True)
        raise


def write_document(path: Path, content: Mapping[str, Any] | list[Any]) -> Path:
    """Write JSON, making the folder; return the path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, json.dumps(content, indent=1) + "\n")
    return path


def json_types(value: Any) -> Any:
    """Return a value as JSON types, a dataclass by its fields; numbers that aren't finite become null."""
    if is_dataclass(value):
        return {one.name: json_types(getattr(value, one.name)) for one in fields(value)}
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


type Cells = tuple[list[str], list[list[str]]]
"""A table's header and rows."""


def row_cells(rows: Iterable[Mapping[str, str]]) -> Cells:
    """Cells of rows that name their columns alike."""
    given = list(rows)
    return list(given[0]) if given else ["nothing to show"], [list(row.values()) for row in given]


def column_cells(columns: Mapping[str, tuple[str, FloatArray]]) -> Cells:
    """Cells of columns (n,), each with its format; a number that isn't known is a dash."""
    texts = [["-" if np.isnan(value) else format(value, form) for value in values] for form, values in columns.values()]
    return list(columns), [list(row) for row in zip(*texts, strict=True)]


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

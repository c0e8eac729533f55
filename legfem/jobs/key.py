"""The key of finished work: a hash of all that it depends on, inputs and code."""

import ast
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from legfem.common.documents import package_version


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


_ROOT = Path(__file__).resolve().parents[2]


@cache
def code_fingerprint(*modules: str) -> str:
    """Return a hash of modules, of all of legfem that they import, and of the solvers' versions.

    Comments and docstrings don't count: they change no number.

    Parameters
    ----------
    modules
        Full names, for example ``legfem.experiments.plane_strain``.
    """
    digest = hashlib.sha256()
    for package in ("fenics-dolfinx", "petsc4py", "gmsh"):
        digest.update(package_version(package).encode())
    for name in sorted(_imported(modules)):
        digest.update(_read(name)[0])
    return digest.hexdigest()[:16]


def _imported(modules: tuple[str, ...]) -> set[str]:
    """Return modules of this project that are imported, directly or not, with those given."""
    found: set[str] = set()
    waiting = list(modules)
    while waiting:
        name = waiting.pop()
        if name not in found and _file(name) is not None:
            found.add(name)
            waiting += _read(name)[1]
    return found


def _file(name: str) -> Path | None:
    if name.partition(".")[0] not in ("legfem", "studies"):
        return None
    path = _ROOT.joinpath(*name.split("."))
    for file in (path.with_suffix(".py"), path / "__init__.py"):
        if file.is_file():
            return file
    return None


@cache
def _read(name: str) -> tuple[bytes, list[str]]:
    """Return a module's name and code without the texts that stand as statements, and what it may import."""
    file = _file(name)
    assert file is not None
    tree, imported = ast.parse(file.read_text(encoding="utf-8")), []
    for node in _statements(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            node.body = [
                entry
                for entry in node.body
                if not (isinstance(entry, ast.Expr) and isinstance(entry.value, ast.Constant))
            ]
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            imported += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Import):
            imported += [alias.name for alias in node.names]
    return name.encode() + ast.dump(tree).encode(), imported


def _statements(tree: ast.Module) -> Iterator[ast.AST]:
    """Yield a tree and all statements within; expressions, of which most of it is, hold none."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        for name in ("body", "orelse", "finalbody", "handlers", "cases"):
            waiting += getattr(node, name, ())

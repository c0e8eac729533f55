"""What code a result depends on."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from legfem.common.versions import package_version

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
        digest.update(name.encode() + ast.dump(_parsed(name)).encode())
    return digest.hexdigest()[:16]


def _imported(modules: tuple[str, ...]) -> set[str]:
    """Return modules of this project that are imported, directly or not, with those given."""
    found: set[str] = set()
    waiting = list(modules)
    while waiting:
        name = waiting.pop()
        if name in found or _file(name) is None:
            continue
        found.add(name)
        for node in _statements(_parsed(name)):
            if isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
                waiting += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
            elif isinstance(node, ast.Import):
                waiting += [alias.name for alias in node.names]
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
def _parsed(name: str) -> ast.Module:
    """Return a module's tree without the texts that stand as statements."""
    file = _file(name)
    assert file is not None
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for node in _statements(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            node.body = [
                entry
                for entry in node.body
                if not (isinstance(entry, ast.Expr) and isinstance(entry.value, ast.Constant))
            ]
    return tree


def _statements(tree: ast.Module) -> Iterator[ast.AST]:
    """Yield a tree and all statements within; expressions, of which most of it is, hold none."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        for name in ("body", "orelse", "finalbody", "handlers", "cases"):
            waiting += getattr(node, name, ())

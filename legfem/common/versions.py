"""Versions of legfem and of what it stands on."""

from __future__ import annotations

import platform
import subprocess
import tomllib
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

# Modules that a package of another name may bring: dolfinx-solver-real has both.
_MODULES = {"fenics-dolfinx": "dolfinx", "petsc4py": "petsc4py"}


def package_version(name: str) -> str:
    """Return an installed package's version, or ``unknown``."""
    try:
        return version(name)
    except PackageNotFoundError:
        module = _MODULES.get(name)
    if module is None or find_spec(module) is None:
        return "unknown"
    return str(import_module(module).__version__)


@cache
def legfem_version() -> str:
    """Version of legfem; of a checkout with its commit (``0.2.0+1a2b3c4``, ``.dirty`` where files were changed)."""
    project = Path(__file__).resolve().parents[2] / "pyproject.toml"
    if not project.is_file():
        return package_version("legfem")
    released = str(tomllib.loads(project.read_text())["project"]["version"])
    asked = ["git", "-C", str(project.parent), "describe", "--always", "--exclude=*", "--dirty=.dirty"]
    try:
        commit = subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return released
    return f"{released}+{commit}" if commit else released


def versions_of(*names: str) -> dict[str, str]:
    """Return versions of ``legfem``, ``python`` and packages, by name; ``dolfinx`` is DOLFINx."""
    own = {"legfem": legfem_version, "python": platform.python_version}
    packages = {"dolfinx": "fenics-dolfinx"}
    return {name: own[name]() if name in own else package_version(packages.get(name, name)) for name in names}

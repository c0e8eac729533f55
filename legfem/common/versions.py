"""Versions of legfem and of what it stands on."""

from __future__ import annotations

import platform
import subprocess
import tomllib
from functools import lru_cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

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
    own = {"legfem": legfem_build(), "python": platform.python_version()}
    packages = {"dolfinx": "fenics-dolfinx"}
    return {name: own.get(name) or package_version(packages.get(name, name)) for name in names}

"""Stiffness of a leg's soft tissues from measurements, and which physics a model of it misses.

>>> import legfem as lf
>>> leg = lf.load_subject("3")
>>> found = lf.identify(leg, law="both")
>>> print(found.summary())
"""

import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if sys.version_info < (3, 12):  # noqa: UP036  (who has a checkout alone asked no installer)
    # Of ``python -m legfem.NAME`` only the line is shown.
    raise (SystemExit if sys.argv[:1] == ["-m"] else ImportError)(
        f"legfem needs Python 3.12 or later, and {sys.executable} is {sys.version.split()[0]}: in a checkout, begin "
        "the command with scripts/in-env; else see docs/install.md"
    )

if TYPE_CHECKING:
    from legfem.api.cohorts import Cohort, Readings, cohort
    from legfem.api.diagnosis import PlannedTests, diagnose, plan
    from legfem.api.identification import identify
    from legfem.api.loading import load_leg, load_sites, load_specimen, load_subject
    from legfem.api.results import Diagnosed, Identification, read_result
    from legfem.api.specimens import DiagnosedFolder
    from legfem.api.stockings import stocking
    from legfem.common.errors import InputError

    __version__: str

HOMES = {
    "cohorts": ("Cohort", "Readings", "cohort"),
    "diagnosis": ("PlannedTests", "diagnose", "plan"),
    "identification": ("identify",),
    "loading": ("load_leg", "load_sites", "load_specimen", "load_subject"),
    "results": ("Diagnosed", "Identification", "read_result"),
    "specimens": ("DiagnosedFolder",),
    "stockings": ("stocking",),
}
"""What the front door leads to, by modules of `legfem.api`."""
__all__ = sorted(["InputError", "__version__", *(name for names in HOMES.values() for name in names)])
_SHARED = ("cohort", "diagnose", "identify", "plan", "stocking")
"""Functions with the name of a module, which ``python -m`` and ``from legfem.cohort import ...`` find by that name."""


def __getattr__(name: str) -> Any:
    """Import what is asked for when it is: ``import legfem`` itself imports nothing."""
    if name == "__version__":
        return importlib.import_module("legfem.common.documents").legfem_version()
    if name == "InputError":
        return importlib.import_module("legfem.common.errors").InputError
    if name in __all__:
        return getattr(importlib.import_module("legfem.api"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return list(__all__)


class _FrontDoor(ModuleType):
    """The package, whose functions stay what they are when the modules of their names are imported."""

    def __setattr__(self, name: str, value: Any) -> None:
        if not (name in _SHARED and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _FrontDoor

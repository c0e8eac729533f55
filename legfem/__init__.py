"""Stiffness of a leg's soft tissues from measurements, and which physics a model of it misses.

>>> import legfem as lf
>>> leg = lf.load_subject("3")
>>> found = lf.identify(leg, law="both")
>>> print(found.summary())
"""

import importlib
import inspect
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
    from legfem.api.cohorts import Cohort, cohort
    from legfem.api.diagnosed import Diagnosed
    from legfem.api.diagnosis import PlannedTests, diagnose, plan
    from legfem.api.identification import identify
    from legfem.api.loading import load_leg, load_sites, load_specimen, load_subject
    from legfem.api.results import Identification, read_result
    from legfem.api.specimens import DiagnosedFolder
    from legfem.api.stockings import stocking
    from legfem.common.errors import InputError

    __version__: str

__all__ = [
    "Cohort",
    "Diagnosed",
    "DiagnosedFolder",
    "Identification",
    "InputError",
    "PlannedTests",
    "__version__",
    "cohort",
    "diagnose",
    "identify",
    "load_leg",
    "load_sites",
    "load_specimen",
    "load_subject",
    "plan",
    "read_result",
    "stocking",
]

_ROOMS = ("cohort", "diagnose", "identify", "plan", "stocking")
"""Rooms that share their name with the function that one enters them by."""


def __getattr__(name: str) -> Any:
    """Import what is asked for when it is: ``import legfem`` itself imports nothing."""
    if name == "__version__":
        return importlib.import_module("legfem.common.documents").legfem_version()
    if name in _ROOMS:
        return importlib.import_module(f"legfem.{name}")
    if name == "InputError":
        return importlib.import_module("legfem.common.errors").InputError
    if name in __all__:
        return getattr(importlib.import_module("legfem.api"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


class _Room(ModuleType):
    """A room that can be called: ``legfem.identify(leg)`` beside ``legfem.inverse.search``."""

    @property
    def __signature__(self) -> inspect.Signature:
        return inspect.signature(self.__wrapped__)

    @property
    def __wrapped__(self) -> Any:
        api = importlib.import_module("legfem.api")
        return getattr(api, self.__name__.rpartition(".")[2])

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        return self.__wrapped__(*arguments, **named)


class _FrontDoor(ModuleType):
    """The package, that makes its rooms callable when they are first imported."""

    def __setattr__(self, name: str, value: Any) -> None:
        if name in _ROOMS and isinstance(value, ModuleType):
            value.__class__ = _Room
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _FrontDoor

"""The front door: ``import legfem as lf``, and a leg's folder becomes a result in one call.

A function loads what it is given by id or path, does all that the command of its name does, and wraps what that found.
The commands call the functions of the modules here; those of the door itself name keywords where something is wrong.
"""

from importlib import import_module
from inspect import isfunction
from typing import Any

from legfem import HOMES
from legfem.api.loading import front, in_python_words


def __getattr__(name: str) -> Any:
    """Import a module when a name of its is first asked for: a leg is loaded without the solver and the figures."""
    home = next((home for home, names in HOMES.items() if name in names), None)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    with in_python_words():
        found = getattr(import_module(f"{__name__}.{home}"), name)
    globals()[name] = found = front(found) if isfunction(found) else found
    return found

"""Registries: one object for every file of a folder, and those that other packages add by entry points."""

import logging
from importlib import import_module
from importlib.metadata import entry_points
from inspect import getmembers, isabstract, isclass, signature
from pkgutil import iter_modules
from types import ModuleType
from typing import Any

_log = logging.getLogger("legfem")


def made_in(module: ModuleType, base: Any) -> list[Any]:
    """Return an instance of each class that a module defines, of a base, that isn't abstract and is made of nothing."""
    own = (kind for _, kind in getmembers(module, isclass) if kind.__module__ == module.__name__)
    whole = (kind for kind in own if issubclass(kind, base) and not isabstract(kind))
    return [
        kind() for kind in whole if all(one.default is not one.empty for one in signature(kind).parameters.values())
    ]


def registered(folder: ModuleType, base: Any, group: str) -> list[Any]:
    """Return an instance of each class that a folder's modules define, and of those of other packages.

    Parameters
    ----------
    folder : module
        Package whose modules count; what one of them imports doesn't, nor what is abstract.
    base : type
        Base of the classes; it may be abstract.
    group : str
        Entry point group of other packages: each entry makes such an instance. A fault of theirs costs itself only.
    """
    modules = (import_module(f"{folder.__name__}.{info.name}") for info in iter_modules(folder.__path__))
    found = [one for module in modules for one in made_in(module, base)]
    for entry in entry_points(group=group):
        try:
            made = entry.load()()
            if not isinstance(made, base):
                raise TypeError(f"{made!r} is no {base.__name__}")
        except Exception as error:
            _log.warning("%s: entry point %s can't be used (%s)", group, entry.name, error)
            continue
        found.append(made)
    return found

"""What a leg's model may leave out, one mechanism a file, and mechanisms of other packages.

A module of this folder gives what it defines. Another package gives mechanisms under the entry point group
"legfem.mechanisms": each entry is a subclass of `Mechanism` (or a function that returns one).
"""

from __future__ import annotations

import logging
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from inspect import getmembers, isclass
from pkgutil import iter_modules

from legfem.inverse.mechanism import Mechanism, Solution, Stiffness, TissueMechanism, Values

__all__ = ["GROUP", "Mechanism", "Solution", "Stiffness", "TissueMechanism", "Values", "mechanism_named", "mechanisms"]

GROUP = "legfem.mechanisms"
_log = logging.getLogger("legfem")


@cache
def mechanisms() -> tuple[Mechanism, ...]:
    """Return all mechanisms, by name."""
    found: dict[str, Mechanism] = {}
    for info in iter_modules(__path__):
        module = import_module(f"{__name__}.{info.name}")
        for _, kind in getmembers(module, isclass):
            own = kind.__module__ == module.__name__
            if own and issubclass(kind, Mechanism) and kind not in (Mechanism, TissueMechanism):
                found[kind.name] = kind()
    for entry in entry_points(group=GROUP):
        try:
            mechanism = entry.load()()
            if not isinstance(mechanism, Mechanism):
                raise TypeError(f"{mechanism!r} is no mechanism")
        except Exception as error:  # another package's fault costs itself only
            _log.warning("%s: entry point %s can't be used (%s)", GROUP, entry.name, error)
            continue
        found[mechanism.name] = mechanism
    return tuple(found[name] for name in sorted(found))


def mechanism_named(name: str) -> Mechanism:
    """Return the mechanism of a name.

    Raises
    ------
    KeyError
        If there is none.
    """
    for mechanism in mechanisms():
        if mechanism.name == name:
            return mechanism
    raise KeyError(name)


__all__ = ["Mechanism", "Solution", "Stiffness", "TissueMechanism", "Values", "mechanism_named", "mechanisms"]

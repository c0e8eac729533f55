"""What a leg's model may leave out, a file for each part of the leg or rig, and mechanisms of other packages.

A module of this folder gives what it defines. Another package gives mechanisms under the entry point group
"legfem.mechanisms": each entry is a subclass of `Mechanism` (or a function that returns one).
"""

import sys
from functools import cache

from legfem.common.registry import registered
from legfem.inverse.mechanism import Mechanism, Solution, Stiffness, TissueMechanism, Values

__all__ = ["GROUP", "Mechanism", "Solution", "Stiffness", "TissueMechanism", "Values", "mechanism_named", "mechanisms"]

GROUP = "legfem.mechanisms"


@cache
def mechanisms() -> tuple[Mechanism, ...]:
    """Return all mechanisms, by name."""
    found = {one.name: one for one in registered(sys.modules[__name__], Mechanism, GROUP)}
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

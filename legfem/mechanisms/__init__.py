"""What a model may leave out, a file for each part of the body or rig, and mechanisms of other packages.

A module of this folder gives what it defines. Another package gives mechanisms under the entry point group
"legfem.mechanisms": each entry is a subclass of `Mechanism` (or a function that returns one).

`OCCURRENCES` says how strong what is left out can be, and how common that is, with its sources. Ranges are those of
living legs and of rigs as labs have them, not those at which a simulation ends. Of `strong` effects (anywhere in the
range, evenly in the logarithm of a factor) nobody has counted how many there are, for any of these: the shares are set,
and so is that an effect is as common as any other unless `Mechanism.expected` says otherwise. An entry whose source is
empty has none; it is what someone who watches a test would still overlook. What every living leg has (`always`) isn't
named where recordings can't show it, but C10's interval counts it (`legfem.inverse.averaging`).
"""

import sys
from collections.abc import Sequence
from functools import cache
from itertools import pairwise

import numpy as np

from legfem.common.registry import registered
from legfem.common.resources import resource
from legfem.common.units import FloatArray
from legfem.geometry.section import MUSCLE, LegSection
from legfem.inverse.mechanism import Mechanism, Occurrence, Solution, Stiffness, TissueMechanism, Values, shape
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Prior

__all__ = [
    "GROUP",
    "Mechanism",
    "Solution",
    "Stiffness",
    "TissueMechanism",
    "Values",
    "mechanism_named",
    "mechanisms",
    "mechanisms_of",
]

GROUP = "legfem.mechanisms"


@cache
def mechanisms() -> tuple[Mechanism, ...]:
    """Return all mechanisms, by name."""
    found = {one.name: one for one in registered(sys.modules[__name__], Mechanism, GROUP)}
    return tuple(found[name] for name in sorted(found))


def mechanisms_of(section: LegSection | None) -> Sequence[Mechanism]:
    """Return the mechanisms of a limb: of its own bones, and of muscles by name. Of none those that know no limb."""
    if section is None:
        return mechanisms()
    found = [own for one in mechanisms() for own in one.in_limb(section)]
    return [one.restated(statement=one.of_pad) if one.of_pad and MUSCLE in section.lacks else one for one in found]


def mechanism_named(name: str, section: LegSection | None = None) -> Mechanism:
    """Return the mechanism of a name, of a limb.

    Raises
    ------
    KeyError
        If there is none.
    """
    return {one.name: one for one in mechanisms_of(section)}[name]


def shown_in(variant: str, section: LegSection | None = None) -> list[TissueMechanism]:
    """Return the mechanisms that a variant of a body's model, or of a limb's, shows; none of the plain one."""
    every = (one for one in mechanisms_of(section) if isinstance(one, TissueMechanism))
    lacks = () if section is None else section.lacks
    return [one for one in every if one.variant == variant and one.needs not in lacks]


MOMENTS = 12
"""At which searches begin."""


def smooth_switch(fraction: FloatArray) -> FloatArray:
    """Return 0 below 0, 1 above 1 and 3 x^2 - 2 x^3 between."""
    x = np.clip(fraction, 0.0, 1.0)
    return np.asarray(x * x * (3 - 2 * x))


ONSET = shape(
    "onset",
    "-",
    "when it begins, over the time of the shortest programme",
    Prior(0.5, 0.3, "linear", "any time"),
    (0.0, 1.0),
)
AWAY = shape(
    "away",
    "-",
    "how long until that was over, likewise; above one it stayed",
    Prior(0.3, 1.2, "log", "nothing is known"),
    (0.01, 3.0),
)


def passing(values: Values, observed: Observations) -> FloatArray:
    """Return the course (n,) from 0 to 1 of what begins at an ``onset``, takes its ``rise``, and is over later."""
    since = observed.time / shortest_programme(observed) - values["onset"]
    rise = max(values["rise"], 1e-6)
    return smooth_switch(since / rise) - smooth_switch((since - values["away"]) / rise)


def shortest_programme(observed: Observations) -> float:
    """Return how long it takes, s."""
    return min(float(stations.protocol.time[-1]) for stations in observed.protocols)


def moments(observed: Observations) -> list[tuple[float, float]]:
    """Return moments through a programme and how far they are apart, over the shortest one's time.

    They lie evenly over the stations, and not over the time: a loading of a few seconds before a
    long hold has its share.
    """
    shortest = shortest_programme(observed)
    times = next(s.time for s in observed.protocols if s.protocol.time[-1] == shortest) / shortest
    ends = np.interp(np.linspace(0.0, 1.0, MOMENTS + 1), np.linspace(0.0, 1.0, len(times)), times)
    return [(float(0.5 * (a + b)), float(b - a)) for a, b in pairwise(ends)]


OCCURRENCES = resource("people/occurrences", dict[str, Occurrence])

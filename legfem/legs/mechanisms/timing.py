"""When something happens during a test."""

from itertools import pairwise

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.observations import Observations

MOMENTS = 12
"""At which searches begin."""


def smooth_switch(fraction: FloatArray) -> FloatArray:
    """Return 0 below 0, 1 above 1 and 3 x^2 - 2 x^3 between."""
    x = np.clip(fraction, 0.0, 1.0)
    return np.asarray(x * x * (3 - 2 * x))


def shortest_programme(observed: Observations) -> float:
    """Return how long it takes, s."""
    return min(float(stations.protocol.time[-1]) for stations in observed.protocols)


def moments(observed: Observations, count: int = MOMENTS) -> list[tuple[float, float]]:
    """Return moments through a programme and how far they are apart, over the shortest one's time.

    They lie evenly over the stations, and not over the time: a loading of a few seconds before a
    long hold has its share.
    """
    shortest = shortest_programme(observed)
    times = next(s.time for s in observed.protocols if s.protocol.time[-1] == shortest) / shortest
    ends = np.interp(np.linspace(0.0, 1.0, count + 1), np.linspace(0.0, 1.0, len(times)), times)
    return [(float(0.5 * (a + b)), float(b - a)) for a, b in pairwise(ends)]

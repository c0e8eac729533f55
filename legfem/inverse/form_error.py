r"""What a law that misses may do to a stiffness: how stiff each part of the recordings says the tissue is.

A law that doesn't describe recordings fits their parts with different constants, and what its constant means hangs on
the part that was looked at. Of forces m and predictions f in a part, with errors of covariance C,

.. math:: k = f^T m / f^T f, \qquad s^2 = f^T C f / (f^T f)^2

is the factor on all stiffness that the part asks for, with its standard error. Parts are a few readings of one number:
the greatest :math:`|\ln k|` beyond errors is taken as one standard deviation of what the misfit may do to a stiffness.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from legfem.common.units import FloatArray
from legfem.inverse.readings import Channel

THIRDS = "first", "second", "last"
_FEWEST = 3
"""Readings of a part."""
_DEVIATIONS = 1.96
"""Of 95 %, either way."""
_LARGEST = 50.0
"""Logarithm of a factor that is beyond all bounds."""


@dataclass(frozen=True)
class PartDeparture:
    """The part of the recordings that departs most from a law."""

    part: str
    """In words."""
    factor: float
    """On all stiffness, that it asks for."""
    by: float
    """Logarithm of that without what errors make, 0 at least; infinite where no stiffness describes it."""

    def carried(self, value: float, interval: tuple[float, float], bounds: tuple[float, float]) -> tuple[float, float]:
        """Return a stiffness' 95 % interval, no narrower than that leaves it, within its bounds."""
        if not self.by or value <= 0.0:
            return interval
        factor = math.exp(min(_DEVIATIONS * self.by, _LARGEST))
        return max(bounds[0], min(interval[0], value / factor)), min(bounds[1], max(interval[1], value * factor))

    @property
    def text(self) -> str:
        """What is said of it."""
        if self.factor <= 0.0:
            return f"no stiffness describes {self.part}"
        return f"{self.part} by itself gives {self.factor:.2g} times this stiffness"


NO_DEPARTURE = PartDeparture("", 1.0, 0.0)


def third_of(displacement: FloatArray, depth: float) -> NDArray[np.int_]:
    """Return the third of a depth that displacements (n,) lie in."""
    return np.clip((len(THIRDS) * displacement / depth).astype(int), 0, len(THIRDS) - 1)


def by_third(third: NDArray[np.int_], after: NDArray[np.bool_]) -> Mapping[str, NDArray[np.int_]]:
    """Return places of readings (n,) by the loading's third that they lie in; of those after it none."""
    found = {f"the {name} third of the depth": np.flatnonzero((third == k) & ~after) for k, name in enumerate(THIRDS)}
    return {name: places for name, places in found.items() if len(places) >= _FEWEST}


def thirds_of(forces: Sequence[tuple[Channel, int]]) -> Mapping[str, NDArray[np.int_]]:
    """Return places of forces that are read over displacement, by the third of their own test's depth.

    Parameters
    ----------
    forces
        Of every test, with the place of its first.
    """
    told = [(one, first) for one, first in forces if one.along == "displacement_mm"]
    if not told:
        return {}
    third = np.concatenate([third_of(one.station, float(one.station.max())) for one, _ in told])
    places = np.concatenate([first + np.arange(len(one)) for one, first in told])
    return {name: places[inside] for name, inside in by_third(third, np.zeros(len(third), dtype=bool)).items()}


def departure_of(
    parts: Mapping[str, NDArray[np.int_]], measured: FloatArray, predicted: FloatArray, covariance: FloatArray
) -> PartDeparture:
    """Return the part that departs most from predictions.

    Parameters
    ----------
    parts
        Places of readings by a part's name.
    measured, predicted
        (n,).
    covariance
        (n, n): of their differences, but for what the law misses.
    """
    found = NO_DEPARTURE
    for name, places in parts.items():
        force, model = measured[places], predicted[places]
        squares = float(model @ model)
        if not squares:
            continue
        factor = float(model @ force) / squares
        error = math.sqrt(float(model @ covariance[np.ix_(places, places)] @ model)) / squares
        if factor <= 0.0:
            return PartDeparture(name, factor, math.inf)
        by = math.sqrt(max(math.log(factor) ** 2 - (error / factor) ** 2, 0.0))
        if by > found.by:
            found = PartDeparture(name, factor, by)
    return found

"""Where a leg is pressed, and at which places a channel sees it."""

from dataclasses import dataclass

import numpy as np

from legfem.common.units import FloatArray
from legfem.geometry.indenter import Indenter, first_touch
from legfem.geometry.section import LegSection


@dataclass(frozen=True)
class Sight:
    """Places at which a channel is seen, each of which has a course of its own.

    Parameters
    ----------
    name
        Of the channel's kind.
    places
        What tells each from others, as its kind has it.
    """

    name: str
    places: tuple[tuple[float, ...], ...]


@dataclass(frozen=True, eq=False)
class TravelLine:
    """A line of travel.

    Parameters
    ----------
    origin : (d,) array
        A point on it, mm.
    direction : (d,) array
        Its unit vector.
    """

    origin: FloatArray
    direction: FloatArray


@dataclass(frozen=True, eq=False)
class Site:
    """Where a leg is pressed: its section in the plane of the travel, and the indenter."""

    section: LegSection
    indenter: Indenter

    @property
    def touch(self) -> FloatArray:
        """The cylinder's axis at first touch (2,), mm."""
        return np.asarray(first_touch(self.section.skin, self.indenter.radius, self.indenter.aim, self.direction))

    @property
    def direction(self) -> FloatArray:
        """Unit vector of the travel (2,)."""
        return np.asarray(self.indenter.direction)

    @property
    def deepest(self) -> FloatArray:
        """Deepest point of the cylinder's face at first touch (2,), mm."""
        return np.asarray(self.touch + self.indenter.radius * self.direction)

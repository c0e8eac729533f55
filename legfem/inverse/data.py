"""What was measured in a test: channels of readings along it, each with its errors."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from legfem.common.units import FloatArray


@dataclass(frozen=True, eq=False)
class Channel:
    """Readings of one quantity.

    Parameters
    ----------
    name : str
        Of the quantity, as a file's column has it without its unit: ``force``, ``lateral_force``, ``fat_thickness``.
    unit : str
        N, mm, MPa or -.
    station : (n,) array
        Where along the test the readings were taken: displacement after first contact (mm), or time (s).
    along : str
        Name of the stations with their unit, ``displacement_mm`` or ``time_s``.
    values : (n,) array
        Readings.
    sd : (n,) array
        Standard error of each reading.
    """

    name: str
    unit: str
    station: FloatArray
    along: str
    values: FloatArray
    sd: FloatArray

    def __len__(self) -> int:
        """Number n of readings."""
        return len(self.values)


@dataclass(frozen=True, eq=False)
class Data:
    """All channels of one test, which a problem has as one vector of n readings, channel after channel."""

    channels: tuple[Channel, ...]

    @cached_property
    def values(self) -> FloatArray:
        """Readings of all channels, (n,), each in its channel's unit."""
        return np.concatenate([channel.values for channel in self.channels])

    @cached_property
    def spans(self) -> tuple[slice, ...]:
        """Place of every channel's readings in `values`."""
        ends = np.cumsum([0, *map(len, self.channels)])
        return tuple(slice(*pair) for pair in pairwise(ends))

    def __len__(self) -> int:
        """Number n of readings, of all channels together."""
        return len(self.values)


@dataclass(frozen=True, eq=False)
class MeasuredTest:
    """A test's readings at its stations; a `legfem.inverse.fit.Measured`."""

    name: str
    data: Data

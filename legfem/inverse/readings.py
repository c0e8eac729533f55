r"""What was measured in a test, and what its instrument shows of a model's force: gain, zero, where contact began.

.. math:: F_\text{read}(d) = g\, F(d - \delta) + z

with the gain :math:`g`, the zero :math:`z` (N) and the contact's offset :math:`\delta` (mm):
contact truly began there, where the recording's displacement counts from 0. Closed form on the
model's curve, so that no solve is needed for any of the three.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

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

    def part(self, rows: NDArray[np.int_]) -> "Channel":
        """Return some of the readings, by their places."""
        return replace(self, station=self.station[rows], values=self.values[rows], sd=self.sd[rows])


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


class InstrumentNumber(NamedTuple):
    """A number of the instrument."""

    unit: str
    null: float
    """At which the instrument shows the force as it is."""


INSTRUMENT = {
    "instrument.gain": InstrumentNumber("-", 1.0),
    "instrument.zero": InstrumentNumber("N", 0.0),
    "instrument.contact_offset": InstrumentNumber("mm", 0.0),
}


GAIN, ZERO, OFFSET = INSTRUMENT


RELAXATION = {
    "viscoelasticity.ratio": InstrumentNumber("-", 0.0),
    "viscoelasticity.relaxation_time": InstrumentNumber("s", 8.0),
    "viscoelasticity.spread": InstrumentNumber("-", 1.5),
    "viscoelasticity.quickening": InstrumentNumber("-", 0.0),
}
"""Of specimens: what a spectrum makes of the elastic force, see `legfem.specimens.course`."""


READINGS = INSTRUMENT | RELAXATION
"""All that acts on a model's curve in closed form, so that no solve is needed for it."""


@dataclass(frozen=True, eq=False)
class Reading:
    """Readings at displacements from forces on a grid.

    Parameters
    ----------
    grid : (m,) array
        Displacement of the forces (mm), increasing, above 0; the force vanishes at 0.
    displacement : (n,) array
        Of the readings (mm).
    """

    grid: FloatArray
    displacement: FloatArray

    @cached_property
    def _knots(self) -> FloatArray:
        return np.concatenate([[0.0], self.grid])

    @cached_property
    def _coefficients(self) -> FloatArray:
        """A cubic spline's coefficients by the forces; (4, m, m)."""
        unit = np.eye(len(self._knots))[:, 1:]
        return np.asarray(CubicSpline(self._knots, unit).c)

    def at(self, force: FloatArray, offset: FloatArray, derivative: bool = False) -> FloatArray:
        """Return forces (or their slopes) at the displacements less an offset."""
        knots = self._knots
        shape = np.broadcast_shapes(force.shape[:-1], offset.shape)
        whole = np.broadcast_to(force, (*shape, len(self.grid))).reshape(-1, len(self.grid))
        coefficients = self._coefficients @ whole.T
        at = self.displacement - np.broadcast_to(offset, shape).reshape(-1, 1)
        piece = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(knots) - 2)
        third, second, first, value = coefficients[:, piece, np.arange(len(whole))[:, None]]
        t = at - knots[piece]
        result = (
            (3 * third * t + 2 * second) * t + first if derivative else ((third * t + second) * t + first) * t + value
        )
        return np.where(at > 0, result, 0.0).reshape(*shape, len(self.displacement))

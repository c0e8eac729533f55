r"""What was measured in a test, and what its instrument shows of a model's force: gain, zero, where contact began.

.. math:: F_\text{read}(d) = g\, F(d - \delta) + z

with the gain :math:`g`, the zero :math:`z` (N) and the contact's offset :math:`\delta` (mm):
contact truly began there, where the recording's displacement counts from 0. Closed form on the
model's curve, so that no solve is needed for any of the three.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from legfem.common.units import FloatArray, spans_of


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
        return tuple(spans_of(map(len, self.channels)))

    def __len__(self) -> int:
        """Number n of readings, of all channels together."""
        return len(self.values)

    def sizes_by_range(self, share: float) -> FloatArray:
        """Return a share of each channel's range at all of its readings, (n,), at least their greatest error."""
        each = (np.full(len(one), max(share * float(np.ptp(one.values)), float(one.sd.max()))) for one in self.channels)
        return np.concatenate([*each])

    def equal_sizes(self, misfit: FloatArray, counted: NDArray[np.bool_], sd: FloatArray) -> FloatArray:
        """Return standard deviations (n,) that weigh a channel's readings equally.

        Parameters
        ----------
        misfit
            (n,): its root mean square weighs a channel.
        counted
            (n,): over which readings that is.
        sd
            (n,): of the readings themselves, which no channel is weighed by less than.
        """
        found = np.empty(len(misfit))
        for span in self.spans:
            left = misfit[span][counted[span]]
            rms = float(np.sqrt(np.mean(left**2))) if len(left) else 0.0
            found[span] = max(rms, float(np.median(sd[span])))
        return found


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


def unit_spline(grid: FloatArray) -> CubicSpline:
    """Return the spline through nothing at 0 and ones on a grid (g,), mm: what a way takes of values there, (g,)."""
    knots = np.concatenate([[0.0], grid])
    return CubicSpline(knots, np.eye(len(knots))[:, 1:])


def read_at_offsets(matrix_at: Callable[[float], FloatArray], values: FloatArray, offset: FloatArray) -> FloatArray:
    """Return readings (..., n) of a model's values (..., m).

    Parameters
    ----------
    matrix_at
        What readings take of the values where contact began at an offset (mm), (n, m).
    values
        The model's.
    offset
        Where contact began (...), mm.
    """
    shape = np.broadcast_shapes(values.shape[:-1], offset.shape)
    values, offset = np.broadcast_to(values, (*shape, values.shape[-1])), np.broadcast_to(offset, shape)
    # A minimiser may ask for no point at all.
    every = {float(at): matrix_at(float(at)) for at in (0.0, *np.unique(offset))}
    found = np.empty((*shape, len(every[0.0])))
    for at, matrix in every.items():
        found[offset == at] = values[offset == at] @ matrix.T
    return found

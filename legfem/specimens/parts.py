"""One recording beside its test's model: its force at few stations, and what was read beside it at a diagnosis'."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag

from legfem.channels.kinds import CHANNELS
from legfem.common.units import FloatArray
from legfem.inverse.channel_readings import StationChannel
from legfem.inverse.comparison import Prediction
from legfem.inverse.errors import error_model
from legfem.inverse.observations import Observations, StationReading, observe
from legfem.inverse.readings import INSTRUMENT, OFFSET, READINGS, RELAXATION, read_at_offsets, unit_spline
from legfem.inverse.trial_noise import estimate_noise
from legfem.solve.path import ForceCurve
from legfem.specimens.course import SLOW_SHARE, STATIONS, Course, relaxed
from legfem.specimens.nuisances import OnsetEffect
from legfem.specimens.sizes import SpecimenRecording

GRID = 50
"""Displacements at which a test's force is known to the search."""
_BEYOND = 1.01
"""Time to which channels are read, over the course's: a frame at its end counts, however contact's time is found."""
_OFFSET = list(INSTRUMENT).index(OFFSET)
_STEP = 1e-5


def grid_to(depth: float) -> FloatArray:
    """Return the grid (m,), mm, of a test pressed to a depth: finer at first."""
    return np.asarray(depth * (np.arange(1, GRID + 1) / GRID) ** 1.3)


@cache
def _spline_to(depth: float) -> CubicSpline:
    """Return what a way takes of a test's force on its grid: recordings of one test share it."""
    return unit_spline(grid_to(depth))


def slopes_by_readings(read: Callable[[FloatArray], FloatArray], readings: FloatArray) -> dict[str, FloatArray]:
    """Return the derivatives (n,) of what is read by the numbers of `READINGS`, by differences."""
    found = {}
    for k, name in enumerate(READINGS):
        step = _STEP * max(abs(readings[k]), 0.1)
        ends = np.repeat(readings[None], 2, axis=0)
        ends[:, k] += (step, -step)
        up, down = read(ends)
        found[name] = (up - down) / (2 * step)
    return found


def weighed_with_force(recording: SpecimenRecording) -> set[str]:
    """Return the channels that are weighed with a force: layers' thicknesses, and what is nothing at rest."""
    more = [name for name in recording.sizes.kind.beside if CHANNELS[name].at_rest == 0.0]
    return {*recording.sizes.thicknesses, *more}


def _observed(recording: SpecimenRecording, names: Collection[str]) -> Observations | None:
    """Return a recording's stations with the named channels' readings within its course; None where it has none."""
    if not {one.name for one in recording.recording.channels}.intersection(names):
        return None
    observed, end = observe([recording.from_contact]), recording.course.samples.time[-1]
    found = [one.part(one.time <= _BEYOND * end) for one in observed.channels if one.name in names]
    kept = tuple(one for one in found if len(one.values))
    return replace(observed, channels=kept) if kept else None


@dataclass(frozen=True, eq=False)
class Part:
    """One recording, and what its test's model makes of that: s forces, and k readings beside them.

    Parameters
    ----------
    recording : SpecimenRecording
        With its course.
    onset : OnsetEffect
        What its force owes to where contact is.
    test : int
        Number of its test among those that are solved.
    depth : float
        mm that the test is solved to.
    relaxes : bool
        Whether loads relax.
    kind : str
        Test, and how fibres lie in it: the model's shape errs alike in all of one.
    beside : StationReading, optional
        What was read beside the force, and what that takes of the model's courses on the grid.
    relative_sd : float
        Standard deviation of a layer's stated thickness, over that.
    """

    recording: SpecimenRecording
    onset: OnsetEffect
    test: int
    depth: float
    relaxes: bool
    kind: str = ""
    beside: StationReading | None = None
    relative_sd: float = 0.0

    def with_channels(self, names: Collection[str], relative_sd: float) -> "Part":
        """Return the recording with the named channels beside its force, as far as it has them."""
        observed = _observed(self.recording, names)
        station = None if observed is None else StationReading(observed, np.zeros(1), grid_to(self.depth))
        return replace(self, beside=station, relative_sd=relative_sd)

    @property
    def course(self) -> Course:
        """What the recording shows after first contact."""
        return self.recording.course

    @cached_property
    def _plain(self) -> FloatArray:
        """What its forces take of the model's, (s, `GRID`)."""
        return np.asarray(_spline_to(self.depth)(self.course.displacement))

    def _matrix(self, offset: float) -> FloatArray:
        """Return what its forces take of the model's, contact having begun at an offset (mm); (s, `GRID`)."""
        if not offset:
            return self._plain
        return np.asarray(_spline_to(self.depth)(np.maximum(self.course.displacement - offset, 0.0)))

    def felt(self, forces: FloatArray, instrument: FloatArray) -> FloatArray:
        """Return what is felt (..., s) of all tests' forces (..., m), before gain and zero."""
        own = forces[..., self.test * GRID : (self.test + 1) * GRID]
        elastic = read_at_offsets(self._matrix, own, instrument[..., _OFFSET])
        if not self.relaxes:
            return elastic
        share = self.course.displacement / self.depth
        return relaxed(self.course.time, share, elastic, instrument[..., len(INSTRUMENT) :])

    def force_errors(self, force: FloatArray) -> tuple[FloatArray, ...]:
        """Return covariances (s, s), N2, of its forces about predicted ones (s,): white, slow, by contact's place."""
        course = self.course
        d, errors = course.displacement, course.instrument
        # A hold's steps are shorter than any of the loading's.
        step = np.diff(d, prepend=0.0)
        way = np.maximum(np.abs(step), 0.5 * course.depth / STATIONS)
        slope = np.maximum(np.sign(step) * np.diff(force, prepend=0.0), 0.0) / way
        white = (errors.force_sd**2 + (slope * errors.displacement_sd) ** 2) / course.count
        apart = np.abs(d[:, None] - d) / (course.depth / 3)
        slow = SLOW_SHARE * errors.force_sd**2 * np.exp(-apart)
        later = self.onset.modes[:, 0]
        return np.diag((1 - SLOW_SHARE) * white), slow + self.onset.zero_sd**2, np.outer(later, later)

    @property
    def channels(self) -> tuple[StationChannel, ...]:
        """Beside the force, in the order of the readings."""
        return () if self.beside is None else self.beside.observed.channels

    @cached_property
    def values(self) -> FloatArray:
        """The readings beside the force (k,), each in its unit."""
        return np.concatenate([np.zeros(0), *(one.values for one in self.channels)])

    @cached_property
    def slope(self) -> FloatArray:
        """Their slope (k,) by the displacement, per mm."""
        return np.concatenate([np.zeros(0), *(one.slope(one.values) for one in self.channels)])

    @cached_property
    def errors(self) -> tuple[FloatArray, FloatArray]:
        """Their covariance (k, k) by instruments and model, and the model's of it."""
        if self.beside is None:
            return np.zeros((0, 0)), np.zeros((0, 0))
        observed, instrument = self.beside.observed, self.course.instrument
        found = error_model(observed, estimate_noise(observed, instrument), observed.values)
        forces = len(observed.force)
        return found.covariance[forces:, forces:], found.of_model[forces:, forces:]

    @cached_property
    def of_sizes(self) -> FloatArray:
        """Their covariance by stated thicknesses: a layer's that is off is so in proportion all along the test."""
        layers = self.recording.sizes.thicknesses
        each = [self.relative_sd * (one.name in layers) * one.values for one in self.channels]
        return np.asarray(block_diag(np.zeros((0, 0)), *(np.outer(one, one) for one in each)))

    @property
    def scale(self) -> FloatArray:
        """Sizes of the model's values beside its forces: of each course its value at rest and changes on the grid."""
        if self.beside is None:
            return np.zeros(0)
        return self.beside.linear_scale[len(self.beside.grid) :]

    def _matrix_beside(self, offset: float) -> FloatArray:
        """Return what elastic readings take of the model's values, contact having begun at an offset (mm)."""
        assert self.beside is not None
        whole = self.beside.matrix(offset=offset) if offset else self.beside.plain
        return whole[len(self.beside.observed.force) :, len(self.beside.grid) :]

    def read(self, values: FloatArray, instrument: FloatArray) -> FloatArray:
        """Return readings (..., k) of the model's values beside its forces; loads relax as forces do."""
        elastic = read_at_offsets(self._matrix_beside, values, instrument[..., _OFFSET])
        if not self.relaxes:
            return elastic
        numbers, ends = instrument[..., len(INSTRUMENT) :], np.cumsum([len(one.values) for one in self.channels])
        felt = [
            relaxed(one.time, one.displacement / self.depth, block, numbers) if one.kind.follows_force else block
            for one, block in zip(self.channels, np.split(elastic, ends[:-1], axis=-1), strict=True)
        ]
        return np.concatenate(felt, axis=-1)

    def predict(self, curve: ForceCurve, instrument: FloatArray) -> Prediction:
        """Return the readings beside the force of a solve."""
        assert self.beside is not None
        grid, (whole, rates) = len(self.beside.grid), self.beside.model_values(curve)
        values, by = whole[grid:], {name: each[grid:] for name, each in rates.items()}
        seen = {name: self.read(each, instrument) for name, each in by.items()}
        slopes = slopes_by_readings(partial(self.read, values), instrument)
        seen |= {name: slope for name, slope in slopes.items() if name == OFFSET or name in RELAXATION}
        return Prediction(self.read(values, instrument), seen, values, by)

"""One recording beside its test's model: its force at few stations, and what was read beside it at a diagnosis'."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag

from legfem.channels.kinds import CHANNELS
from legfem.common.units import FloatArray
from legfem.inverse.catalogue import Values
from legfem.inverse.channel_readings import StationChannel
from legfem.inverse.comparison import Prediction
from legfem.inverse.errors import error_model, numerical_covariance
from legfem.inverse.intervals import by_third
from legfem.inverse.observations import Observations, StationReading, observe
from legfem.inverse.readings import INSTRUMENT, READINGS, Data, read_at_offsets, unit_spline
from legfem.inverse.trial_noise import estimate_noise
from legfem.solve.path import ForceCurve
from legfem.specimens.course import SLOW_SHARE, STATIONS, Course, relaxed
from legfem.specimens.nuisances import OnsetEffect, power_of
from legfem.specimens.sizes import SpecimenRecording

GRID = 50
"""Displacements at which a test's force is known to the search."""
_BEYOND = 1.01
"""Time to which channels are read, over the course's: a frame at its end counts, however contact's time is found."""
_GAIN, _ZERO, _OFFSET = range(len(INSTRUMENT))
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

    @property
    def channels(self) -> tuple[StationChannel, ...]:
        """Beside the force, in the order of the readings."""
        return () if self.beside is None else self.beside.observed.channels

    @cached_property
    def data(self) -> Data:
        """The force (N), and readings of channels in their units."""
        return Data((*self.recording.data.channels, *(one.channel for one in self.channels)))

    @cached_property
    def is_force(self) -> NDArray[np.bool_]:
        """Which of the readings (n,) are forces."""
        return np.arange(len(self.data)) < len(self.course.time)

    @cached_property
    def slope(self) -> FloatArray:
        """Slope (n,) of the readings by the displacement, per mm: what they lose as contact is later."""
        return np.concatenate([self.onset.slope, *(one.slope(one.values) for one in self.channels)])

    @property
    def expected(self) -> FloatArray:
        """Readings (n,) as they are expected of a contact where it is taken to be."""
        return np.asarray(self.data.values - self.onset.ahead * self.slope)

    @property
    def if_deeper(self) -> FloatArray:
        """Change of the readings (n,) per relative change of the displacements.

        Of forces as if in proportion to a power of the depth, which holds and returns keep to.
        """
        others = (one.displacement * one.slope(one.values) for one in self.channels)
        return -np.concatenate([power_of(self.course) * self.course.force, *others])

    @property
    def parts_along(self) -> Mapping[str, NDArray[np.int_]]:
        """Places of the loading's forces in each third of its depth."""
        course = self.course
        return by_third(course.displacement, course.depth, course.time > course.arrival * (1 + 1e-9))

    @property
    def reach(self) -> str:
        """The test's depth."""
        return f"{self.depth:.3g} mm"

    def reached_by(self, curve: ForceCurve) -> bool:
        """Whether the test came to its depth."""
        return curve.depth >= self.depth - 1e-9

    def unseen_in(self, curve: ForceCurve) -> Sequence[str]:
        """Names of the channels that the test's solve doesn't have."""
        return [] if self.beside is None else self.beside.unseen_in(curve)

    @cached_property
    def linear_scale(self) -> FloatArray:
        """Sizes of the model's values: 0 of forces on the grid, and of each course its value at rest and changes."""
        return np.zeros(GRID) if self.beside is None else self.beside.linear_scale

    @cached_property
    def _plain(self) -> FloatArray:
        return self._taking(0.0)

    def _matrix(self, offset: float) -> FloatArray:
        """Return what elastic readings take of the model's values, contact having begun at an offset (mm); (n, m)."""
        return self._taking(offset) if offset else self._plain

    def _taking(self, offset: float) -> FloatArray:
        forces = _spline_to(self.depth)(np.maximum(self.course.displacement - offset, 0.0))
        if self.beside is None:
            return np.asarray(forces)
        whole = self.beside.matrix(offset=offset)
        return np.asarray(block_diag(forces, whole[len(self.beside.observed.force) :, GRID:]))

    def read(self, model_values: FloatArray, instrument: FloatArray) -> FloatArray:
        """Return readings (..., n) of the model's values (..., m); loads relax."""
        return np.asarray(self._felt(model_values, instrument) + self.is_force * instrument[..., _ZERO, None])

    def _felt(self, model_values: FloatArray, instrument: FloatArray) -> FloatArray:
        """Return the same but for the force's zero."""
        felt = read_at_offsets(self._matrix, model_values, instrument[..., _OFFSET])
        courses: tuple[Course | StationChannel, ...] = (self.course, *self.channels) if self.relaxes else ()
        for span, one in zip(self.data.spans, courses, strict=False):
            if isinstance(one, Course) or one.kind.follows_force:
                numbers, share = instrument[..., len(INSTRUMENT) :], one.displacement / self.depth
                felt[..., span] = relaxed(one.time, share, felt[..., span], numbers)
        return np.where(self.is_force, instrument[..., _GAIN, None], 1.0) * felt

    def predict(self, curve: ForceCurve, values: Values, instrument: FloatArray) -> Prediction:
        """Return the readings of a solve."""
        grid = grid_to(self.depth)
        force, by = curve(grid), {name: curve.sensitivity(name, grid) for name in curve.sensitivities}
        model, rates = (force, by) if self.beside is None else self.beside.model_values(curve)
        seen = {name: self._felt(each, instrument) for name, each in rates.items()}
        seen |= slopes_by_readings(partial(self.read, model), instrument)
        return Prediction(self.read(model, instrument), seen, model, rates)

    def own_errors(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return covariances (n, n) about predicted readings (n,), of what is read of the force and of the model."""
        course, force = self.course, values[self.is_force]
        d, errors = course.displacement, course.instrument
        # A hold's steps are shorter than any of the loading's.
        step = np.diff(d, prepend=0.0)
        way = np.maximum(np.abs(step), 0.5 * course.depth / STATIONS)
        slope = np.maximum(np.sign(step) * np.diff(force, prepend=0.0), 0.0) / way
        white = (errors.force_sd**2 + (slope * errors.displacement_sd) ** 2) / course.count
        apart = np.abs(d[:, None] - d) / (course.depth / 3)
        slow = SLOW_SHARE * errors.force_sd**2 * np.exp(-apart)
        # Where contact is moves forces and channels together.
        later, numerical = self.onset.way * self.slope, self.errors[1].copy()
        read, own = np.outer(later, later), np.s_[: len(d), : len(d)]
        read[own] += np.diag((1 - SLOW_SHARE) * white) + slow + self.onset.zero_sd**2
        numerical[own] = numerical_covariance(d, force, length=course.depth / 3, power=1.0)
        return read, numerical

    @cached_property
    def errors(self) -> tuple[FloatArray, FloatArray]:
        """Covariances (n, n) of the readings beside the force, by instruments and by the model."""
        nothing = np.zeros((len(self.course.time),) * 2)
        if self.beside is None:
            return nothing, nothing
        observed, forces = self.beside.observed, len(self.beside.observed.force)
        found = error_model(observed, estimate_noise(observed, self.course.instrument), observed.values)
        read, of_model = (block_diag(nothing, one[forces:, forces:]) for one in (found.covariance, found.of_model))
        return read - of_model, of_model

    @cached_property
    def of_sizes(self) -> FloatArray:
        """Covariance (n, n) by stated thicknesses: a layer's that is off is so in proportion all along the test."""
        layers = self.recording.sizes.thicknesses
        each = (self.relative_sd * (one.name in layers) * one.values for one in self.data.channels)
        return np.asarray(block_diag(*(np.outer(one, one) for one in each)))

"""Channels beside the force in a test's loading: readings, what these err by, and what a model makes of them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.polynomial import Polynomial

from legfem.channels.kinds import CHANNELS
from legfem.common.units import FloatArray
from legfem.data.noise import slowest_error
from legfem.data.phases import LOADING
from legfem.data.recording import RecordedChannel
from legfem.data.segmentation import Segmentation
from legfem.inverse import errors
from legfem.inverse.channel_readings import ChannelReadings, grouped, noise_of
from legfem.inverse.comparison import Prediction
from legfem.inverse.readings import OFFSET, Channel, Reading
from legfem.solve.path import ForceCurve

type Derivatives = dict[str, FloatArray]
type Corrected = Callable[[FloatArray, Derivatives], tuple[FloatArray, Derivatives]]


@dataclass(frozen=True, eq=False)
class LoadingChannel:
    """Readings of one channel in all trials of a test, with covariances (k, k) of their errors.

    Parameters
    ----------
    readings : ChannelReadings
        k of them, along the loading.
    level, slope : (k,) array
        The values and their slope by the depth, per mm, smoothed.
    own : (k, k) array
        Of a reading, a bias, a gain, slow errors, a lag, and of where contact is put.
    outlines : (k, k) array
        By errors of the body's own sizes: a thickness is compared with that of the model.
    """

    readings: ChannelReadings
    level: FloatArray
    slope: FloatArray
    own: FloatArray
    outlines: FloatArray

    def __len__(self) -> int:
        """Return the number of readings."""
        return len(self.readings.values)

    @property
    def depth(self) -> FloatArray:
        """Displacement after first contact, (k,), mm."""
        return self.readings.displacement

    @property
    def instrument(self) -> FloatArray:
        """Covariance (k, k) by the instrument."""
        return np.asarray(self.own + errors.covariance_of_places(self.readings, self.level, {}))

    @cached_property
    def parts(self) -> list[tuple[str, FloatArray]]:
        """Names of the courses that were read, and at which depths each, in the readings' order."""
        own = zip(self.readings.courses, self.readings.rows, strict=True)
        return [(name, self.depth[rows]) for name, rows in own if len(rows)]

    @cached_property
    def channel(self) -> Channel:
        """The readings as all tests have them."""
        return replace(self.readings.channel, sd=np.sqrt(np.diag(self.instrument + self.outlines)))

    @cached_property
    def size(self) -> float:
        """By how much the values change in the test, and at least by a few readings' errors."""
        return max(float(np.ptp(self.readings.values)), 3 * self.readings.kind.usual.reading)

    @cached_property
    def numerical(self) -> FloatArray:
        """Covariance (k, k) of the model's own error, about the measured change."""
        return errors.model_covariance(self.readings, self.slope * self.depth)


def loading_readings(trials: Sequence[Segmentation], deepest: float, model: str) -> Iterator[ChannelReadings]:
    """Yield the readings, in the loading, of every channel that a model gives.

    Parameters
    ----------
    trials
        Of one test.
    deepest
        Depth (mm) down to which readings count.
    model
        ``2d``, ``3d`` or ``specimen``.
    """
    for name in (kind.name for kind in CHANNELS.values() if model in kind.models):
        recorded = [
            (k, trial, channel)
            for k, trial in enumerate(trials)
            for channel in trial.recording.channels
            if channel.name == name
        ]
        readings = _in_loading(recorded, deepest) if recorded else None
        if readings is not None:
            yield readings


def _in_loading(
    recorded: Sequence[tuple[int, Segmentation, RecordedChannel]], deepest: float
) -> ChannelReadings | None:
    found = []
    first = recorded[0][2]
    for k, trial, every in recorded:
        for number, channel in every.at_each_place():
            depth = trial.loading_depths(channel.time)
            for samples in grouped(np.flatnonzero(depth <= deepest + 1e-9), LOADING, bool(first.places)):
                at = float(np.mean(depth[samples]))
                time = float(np.mean(channel.time[samples])) - trial.touched
                speed = trial.loading.speed if at > 0 else 0.0
                value, variance = float(np.mean(channel.values[samples])), noise_of(channel) ** 2 / len(samples)
                found.append((number, k, at, time, speed, value, variance))
    if not found:
        return None
    # Readings of one place stand together.
    courses, numbers, *rest = zip(*sorted(found, key=lambda one: one[0]), strict=True)
    course = np.array(courses) if first.places else None
    return ChannelReadings(
        first.kind, first.accuracy, np.array(numbers), *map(np.array, rest), course=course, places=first.places
    )


def loading_channel(
    readings: ChannelReadings,
    trials: Sequence[Segmentation],
    force: FloatArray,
    contact: FloatArray,
    at_rest: float,
    at_rest_sd: float,
) -> LoadingChannel:
    """Return readings with what they err by.

    Parameters
    ----------
    readings
        k of them.
    trials
        All of the test.
    force
        Along the travel at the readings, (k,), N.
    contact
        Covariance of where contact is put, (k, k), mm2.
    at_rest, at_rest_sd
        The model's own value before contact and that value's standard deviation; 0 of what is nothing then.
    """
    level, slope = np.zeros(len(readings.values)), np.zeros(len(readings.values))
    for rows in (own for own in readings.rows if len(own)):
        at = readings.displacement[rows]
        smooth = _smooth(at, readings.values[rows], at_rest)
        level[rows], slope[rows] = smooth(at), smooth.deriv()(at)
    pressed = [trials[k] for k in np.unique(readings.trial)]
    slowest = slowest_error(
        max(trial.loading.speed for trial in pressed),
        max(float(trial.recording.time[-1]) - trial.touched for trial in pressed),
    )
    own = errors.reading_covariance(readings, slope, slowest, [sorted({int(k) for k in readings.trial})])
    shared = errors.shared_errors(readings, level, force) | errors.errors_of_places(readings, level)
    alike = [np.outer(effect, effect) for effect in shared.values()]
    instrument = own + sum(alike) + contact * np.outer(slope, slope)
    # A size that is off makes a layer thicker in proportion all along the test.
    sizes = at_rest_sd * (np.abs(level) / at_rest if at_rest else np.zeros(len(level)))
    return LoadingChannel(readings, level, slope, np.asarray(instrument), np.outer(sizes, sizes))


def _smooth(depth: FloatArray, values: FloatArray, at_rest: float) -> Polynomial:
    """Return a polynomial in the depth near the values; of few readings one from what is there at rest."""
    several = len(np.unique(np.round(depth, 3)))
    if several <= 2:
        deep = depth > 0
        if not deep.any():
            return Polynomial([float(np.mean(values))])
        rise = float(np.mean((values[deep] - at_rest) / depth[deep]))
        return Polynomial([at_rest, rise])
    return Polynomial.fit(depth, values, min(3, several - 1))


@dataclass(frozen=True, eq=False)
class BesideForce:
    """What a model makes of channels on its grid of displacements, and how they are read.

    Parameters
    ----------
    grid
        Displacements (g,), mm.
    channels
        Read together, in this order.
    """

    grid: FloatArray
    channels: tuple[LoadingChannel, ...]

    @property
    def size(self) -> int:
        """Number of the model's values: of each course its value at rest and changes on the grid."""
        return len(self._parts) * (1 + len(self.grid))

    @cached_property
    def scale(self) -> FloatArray:
        """Sizes of these."""
        return np.concatenate([np.full(1 + len(self.grid), one.size) for one, _, _ in self._parts])

    def told_by(self, curve: ForceCurve) -> bool:
        """Whether a solve gives all courses."""
        return all(course in curve.channels for _, course, _ in self._parts)

    def read(self, values: FloatArray, offset: FloatArray) -> FloatArray:
        """Return the readings (..., n) of the model's values, contact having begun at an offset (...), mm."""
        blocks = np.split(values, len(self._parts), axis=-1)
        each = zip(blocks, self._readings, strict=True)
        return np.concatenate([block[..., :1] + reading.at(block[..., 1:], offset) for block, reading in each], axis=-1)

    def predict(self, curve: ForceCurve, offset: FloatArray, corrected: Corrected | None = None) -> Prediction:
        """Return the readings of a solve.

        Parameters
        ----------
        curve
            The solve.
        offset
            Where contact began, mm.
        corrected
            What acts on changes (g,) of channels that follow the force, and on their derivatives.
        """
        values, by = [], list[Derivatives]()
        at = np.concatenate([[0.0], self.grid])
        for one, course, _ in self._parts:
            level = curve.channel(course, at)
            rates = {p: curve.channel_sensitivity(course, p, at) for p in curve.sensitivities}
            change, by_change = level[1:] - level[0], {p: rate[1:] for p, rate in rates.items()}
            if corrected is not None and one.readings.kind.follows_force:
                change, by_change = corrected(change, by_change)
            values.append(np.concatenate([level[:1], change]))
            by.append({p: np.concatenate([rate[:1], by_change[p]]) for p, rate in rates.items()})
        whole = np.concatenate(values)
        by_parameter = {p: np.concatenate([rates[p] for rates in by]) for p in curve.sensitivities}
        seen = {p: self.read(rates, offset) for p, rates in by_parameter.items()}
        slopes = [-r.at(v[1:], offset, derivative=True) for r, v in zip(self._readings, values, strict=True)]
        return Prediction(self.read(whole, offset), {**seen, OFFSET: np.concatenate(slopes)}, whole, by_parameter)

    @cached_property
    def _parts(self) -> list[tuple[LoadingChannel, str, FloatArray]]:
        """The channel, the course's name, and the depths (mm) of its readings."""
        return [(one, name, depth) for one in self.channels for name, depth in one.parts]

    @cached_property
    def _readings(self) -> list[Reading]:
        return [Reading(self.grid, depth) for _, _, depth in self._parts]

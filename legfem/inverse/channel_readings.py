"""Readings of further channels than the force, as weighted means of the channel's course at the stations.

A reading is a mean of a few samples of one segment. Each sample lies between two stations, by displacement where the
cylinder moves and by time where it is held, so that a dense record and a single ultrasound frame are read alike.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d

from legfem.channels.kind import ChannelAccuracy, ChannelKind
from legfem.channels.kinds import CHANNELS, FILE_OF
from legfem.channels.laid import laid_course
from legfem.common.units import FloatArray
from legfem.data.phases import HOLD, LOADING, UNLOADING
from legfem.data.recording import RecordedChannel, Recording
from legfem.data.segmentation import Segmentation
from legfem.data.smoothing import sample_noise
from legfem.inverse.answer import FitNotice, Notice
from legfem.inverse.readings import Channel
from legfem.inverse.stations import Stations

_MOST = {LOADING: 12, HOLD: 4, UNLOADING: 6}
"""Readings of a segment."""
_MOST_AT_PLACES = {LOADING: 4, HOLD: 1, UNLOADING: 2}
"""Likewise, of each of many places."""
_SLOPE_DEGREE = 3
_IN_AIR_MM = 1.0
"""Before first contact: a sample there is one of the skin just touched."""
_FEWEST = 8
"""Samples that show their noise."""
_FRAMES_ABOVE = 5
"""Frames one after the other, about a reading, in which its place has to reach an instrument's threshold: a quarter of
a record of fewer than 20."""


def not_read(recordings: Sequence[Recording]) -> Iterator[Notice]:
    """Say which readings of a site's channels are left out, and which of its recordings have none of one."""
    every = [{channel.name: channel for channel in one.channels} for one in recordings]
    for name in dict.fromkeys(name for own in every for name in own):
        said, read = {"channel": CHANNELS[name].title}, [own[name] for own in every if name in own]
        names = tuple(one.trial for one, own in zip(recordings, every, strict=True) if name not in own)
        if names:
            yield Notice.of(FitNotice.TRIALS_WITHOUT, count=len(names), trials=len(every), names=names, **said)
        counts = {of: sum(one.left_out.get(of, 0) for one in read) for of in ("limit", "lost", "threshold")}
        if left := sum(counts.values()):
            readings = left + sum(len(one.time) for one in read)
            yield Notice.of(FitNotice.READINGS_LEFT_OUT, left=left, readings=readings, **said, **counts)


@dataclass(frozen=True, eq=False)
class StationChannel:
    """Readings of one channel in all trials of a test, means of its course at stations; arrays are (k,)."""

    kind: ChannelKind
    accuracy: ChannelAccuracy
    trial: NDArray[np.int_]
    """Number of the trial."""
    displacement: FloatArray
    """After first contact, mm; 0 before it."""
    time: FloatArray
    """Since first contact, s."""
    speed: FloatArray
    """Speed of the cylinder, mm/s; negative as it is withdrawn."""
    values: FloatArray
    """In the channel's unit."""
    white_variance: FloatArray
    """Of what is independent from reading to reading, in that squared."""
    weights: FloatArray
    """(k, n): of the course at the n stations of all trials."""
    course: NDArray[np.int_] | None = None
    """Number of each reading's place; None of a channel that has no places."""
    places: tuple[tuple[float, ...], ...] = ()
    """At which it is read."""

    @property
    def courses(self) -> tuple[str, ...]:
        """Names of its courses along the test, one a place."""
        return self.kind.courses(len(self.places))

    @cached_property
    def rows(self) -> tuple[NDArray[np.int_], ...]:
        """Readings of each course."""
        if self.course is None:
            return (np.arange(len(self.values)),)
        return tuple(np.flatnonzero(self.course == k) for k in range(len(self.places)))

    @cached_property
    def laid_courses(self) -> Mapping[str, tuple[str, ...]]:
        """Of what is read in an image, by the way in which it may lie elsewhere: what a step does to each course."""
        ways = self.accuracy.laid if self.kind.image else ()
        return {way: tuple(laid_course(name, way) for name in self.courses) for way in ways}

    @property
    def needed(self) -> tuple[str, ...]:
        """Names of all courses that a model has to give for it."""
        return self.courses + tuple(name for names in self.laid_courses.values() for name in names)

    @cached_property
    def place(self) -> FloatArray:
        """Of each reading, (k, q); q = 0 of a channel that has no places."""
        return np.zeros((len(self.values), 0)) if self.course is None else np.array(self.places)[self.course]

    def alike(self, length: float) -> FloatArray:
        """Return how errors are correlated that are alike over a length (mm) between places, (k, k)."""
        if self.course is None:
            return np.ones((len(self.values), len(self.values)))
        apart = FILE_OF[self.name].apart(self.place)
        return np.asarray(np.exp(-0.5 * (apart / length) ** 2) if length > 0 else 1.0 * (apart == 0))

    @cached_property
    def frame(self) -> NDArray[np.int_]:
        """Number of each reading's frame: those of one trial at one time."""
        keys = np.column_stack([self.trial, np.round(self.time, 3)])
        return np.unique(keys, axis=0, return_inverse=True)[1].ravel()

    def slope(self, values: FloatArray) -> FloatArray:
        """Return the derivative (k,) of values (k,) by the displacement, over all readings of each place."""
        found = np.zeros(len(self.displacement))
        for rows in self.rows:
            at = self.displacement[rows]
            degree = min(_SLOPE_DEGREE, len(np.unique(np.round(at, 1))) - 1)
            if degree >= 1:
                found[rows] = Polynomial.fit(at, values[rows], degree).deriv()(at)
        return found

    def part(self, kept: NDArray[np.bool_]) -> Self:
        """Return some of the readings."""
        every = ((one.name, getattr(self, one.name)) for one in fields(self))
        changed: dict[str, Any] = {name: values[kept] for name, values in every if isinstance(values, np.ndarray)}
        return replace(self, **changed)

    @property
    def name(self) -> str:
        """Of its kind."""
        return self.kind.name

    @property
    def channel(self) -> Channel:
        """The readings as a channel of a test's data."""
        sd = np.sqrt(self.white_variance)
        return Channel(self.name, self.kind.unit, self.displacement, "displacement_mm", self.values, sd)

    def read(self, course: Callable[[str], FloatArray]) -> FloatArray:
        """Return the readings (k,) of courses (n,) at the stations, by their names."""
        found = np.zeros(len(self.values))
        for name, rows in zip(self.courses, self.rows, strict=True):
            if len(rows):
                found[rows] = self.weights[rows] @ course(name)
        return found

    @cached_property
    def nearest(self) -> NDArray[np.int_]:
        """Station that each reading takes most of."""
        return np.argmax(self.weights, axis=1)


def grouped(samples: NDArray[np.int_], phase: str, at_places: bool = False) -> list[NDArray[np.int_]]:
    """Return samples of a segment in the groups that are averaged to a reading, in the order of time."""
    most = min((_MOST_AT_PLACES if at_places else _MOST)[phase], len(samples))
    return np.array_split(samples, most) if most else []


def noise_of(one: RecordedChannel) -> float:
    """Return the standard deviation of a sample: as stated, or as seen from sample to sample where that is more."""
    return max(one.accuracy.reading, sample_noise(one.values) if len(one.values) >= _FEWEST else 0.0)


def channel_readings(trials: Sequence[Segmentation], stations: Sequence[Stations]) -> Iterator[StationChannel]:
    """Yield the readings of every channel that trials have beside the force.

    Parameters
    ----------
    trials
        Recordings.
    stations
        Of each.
    """
    recorded = [(k, one) for k, trial in enumerate(trials) for one in trial.recording.channels]
    for name in dict.fromkeys(one.name for _, one in recorded):
        mine = [(k, one) for k, one in recorded if one.name == name]
        first = mine[0][1]
        readings = [
            _Reading(k, weights, float(np.mean(here.values[samples])), noise_of(here) ** 2 / len(samples), number)
            for k, one in mine
            for number, here in _clear_of_threshold(one).at_each_place()
            for samples, weights in _readings(trials[k], stations[k], here, bool(first.places))
        ]
        if readings:
            yield _at_stations(CHANNELS[name], first.accuracy, readings, stations, first.places)


def _clear_of_threshold(one: RecordedChannel) -> RecordedChannel:
    """Return the readings of places while they stay above an instrument's threshold.

    What is below it isn't recorded, so that of a place which presses by about as much, or not at all, noise would
    choose the readings that count, all of them too high.
    """
    if one.accuracy.threshold is None or one.course is None:
        return one
    frames, frame = np.unique(one.time, return_inverse=True)
    above = np.zeros((len(one.places), len(frames)))
    above[one.course, frame] = 1.0
    row = max(1, min(_FRAMES_ABOVE, len(frames) // 4))
    kept = minimum_filter1d(above, row, mode="nearest")[one.course, frame] > 0
    return replace(one, time=one.time[kept], values=one.values[kept], course=one.course[kept])


@dataclass(frozen=True, eq=False)
class _Reading:
    trial: int
    weights: FloatArray
    """(m,): what it takes of its own trial's stations."""
    value: float
    variance: float
    course: int = 0


def _at_stations(
    kind: ChannelKind,
    accuracy: ChannelAccuracy,
    readings: Sequence[_Reading],
    stations: Sequence[Stations],
    places: tuple[tuple[float, ...], ...] = (),
) -> StationChannel:
    starts = np.cumsum([0, *(len(own.time) for own in stations)])
    weights = np.zeros((len(readings), starts[-1]))
    for row, one in zip(weights, readings, strict=True):
        row[starts[one.trial] : starts[one.trial + 1]] = one.weights
    each = ((one.trial, one.value, one.variance, one.course) for one in readings)
    trial, value, variance, course = map(np.array, zip(*each, strict=True))
    along = zip(*((own.displacement, own.time, own.speed) for own in stations), strict=True)
    displacement, time, speed = (weights @ np.concatenate(one) for one in along)
    numbers = course if places else None
    return StationChannel(
        kind, accuracy, trial, displacement, time, speed, value, variance, weights, course=numbers, places=places
    )


@dataclass(frozen=True)
class PlannedChannel:
    """A channel that a test would record beside its force, as accurate as usual.

    Parameters
    ----------
    name
        Of its kind.
    at
        Displacements in the loading of single frames (mm); all along the test without any.
    places
        At which it is read.
    """

    name: str
    at: tuple[float, ...] = ()
    places: tuple[tuple[float, ...], ...] = ()


def planned_readings(planned: Sequence[PlannedChannel], stations: Sequence[Stations]) -> Iterator[StationChannel]:
    """Yield the readings, of nothing, that channels of a test would give.

    Parameters
    ----------
    planned
        Channels.
    stations
        Of each trial.
    """
    for one in planned:
        kind = CHANNELS[one.name]
        variance = kind.usual.reading**2
        readings = [
            _Reading(k, weights, 0.0, variance / count, number)
            for k, own in enumerate(stations)
            for number in range(max(1, len(one.places)))
            for count, weights in _planned_in(one, own)
        ]
        yield _at_stations(kind, kind.usual, readings, stations, one.places)


def _planned_in(one: PlannedChannel, stations: Stations) -> Iterator[tuple[int, FloatArray]]:
    """Yield of each reading of a trial how many samples it has, and what it takes of the stations."""
    if one.at:
        loading = np.flatnonzero(stations.segment == 0)
        for row in _between(np.array(one.at), stations.displacement[loading]):
            weights = np.zeros(len(stations.time))
            weights[loading] = row
            yield 1, weights
        return
    for number in np.unique(stations.segment):
        here = np.flatnonzero(stations.segment == number)
        for group in grouped(here, str(stations.phase[here[0]]), bool(one.places)):
            weights = np.zeros(len(stations.time))
            weights[group] = 1.0 / len(group)
            yield len(group), weights


def _readings(
    trial: Segmentation, stations: Stations, one: RecordedChannel, at_places: bool = False
) -> Iterator[tuple[NDArray[np.int_], FloatArray]]:
    """Yield each reading's samples, and what it takes of the trial's stations (m,)."""
    since = one.time - trial.touched
    at = np.interp(one.time, trial.recording.time, trial.smooth) - trial.contact.displacement
    inside = (
        (one.time >= trial.recording.time[0])
        & (one.time <= trial.recording.time[-1])
        & (at > -_IN_AIR_MM * trial.scales.way)
    )
    begins = -np.inf
    for number, segment in enumerate(trial.segments):
        here = np.flatnonzero(stations.segment == number)
        later = trial.segments[number + 1].time if number + 1 < len(trial.segments) else np.zeros(0)
        ends = 0.5 * (segment.time[-1] + later[0]) if len(segment.time) and len(later) else np.inf
        if len(here):
            held = segment.phase == HOLD
            along = since - segment.time[0] if held else np.maximum(at, 0.0)
            places = stations.time[here] - stations.protocol.time[number] if held else stations.displacement[here]
            # Samples lie no further beyond the stations than these are apart.
            apart = float(np.abs(np.diff(places)).max())
            near = (along >= places.min() - apart) & (along <= places.max() + apart)
            mine = np.flatnonzero(inside & (since >= begins) & (since < ends) & near)
            for samples in grouped(mine, segment.phase, at_places):
                weights = np.zeros(len(stations.time))
                weights[here] = _between(along[samples], places).mean(axis=0)
                yield samples, weights
        begins = ends


def _between(along: FloatArray, places: FloatArray) -> FloatArray:
    """Return what straight lines between stations, and beyond them, take of each; (k, m)."""
    order = np.argsort(places)
    x = places[order]
    left = np.clip(np.searchsorted(x, along) - 1, 0, len(x) - 2)
    share = (along - x[left]) / (x[left + 1] - x[left])
    found = np.zeros((len(along), len(x)))
    rows = np.arange(len(along))
    found[rows, order[left]], found[rows, order[left + 1]] = 1 - share, share
    return found

"""How a lab sees a leg beside its force: errors that are wider and of other shapes than a diagnosis assumes.

Thicknesses to 0.3 to 0.6 mm with heavy tails, a boundary that is off by up to 0.5 mm, in steps of 0.1 mm and up to
0.3 s late; the lateral force with a cross-talk of up to 2 % of the force along the travel; the skin's rise and
displacements by cameras and speckles whose errors are alike over 10 mm, their image laid 2 mm and 3 degrees beside
where it is; a film under the cylinder that reads 10 % off, creeps, and has sensels of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from legfem.channels.kinds import CHANNELS
from legfem.common.units import FloatArray
from legfem.data import Recording
from legfem.data.recording import RecordedChannel
from studies.cases.sealed_case import SealedCase
from studies.cases.sealed_draw import INSIDE, PRESSURE, SENSELS_MM, laid, places_of, points_of
from studies.making.recording import Course, flicker, record
from studies.making.stated import drawn_errors

FRAMES_HZ, FRAMES_HZ_AT_PLACES = 4.0, 1.0
_ALIKE_MM = 10.0
_HEAVY = 5
"""Degrees of freedom of Student's distribution, of a reading."""


def recorded(case: SealedCase, seed: int, courses: Sequence[Course], air_mm: float) -> list[Recording]:
    """Return what a lab records of a case's trials, further channels with it, with up to so much air before."""
    generator = np.random.default_rng(case.noise_seed)
    errors = replace(drawn_errors(generator), same_travel=False, air=air_mm)
    # The same draws as the recordings begin with.
    air = np.random.default_rng(case.noise_seed)
    drawn_errors(air)
    above = air.uniform(0.0, 1.0, len(courses)) * errors.air
    recordings = record(courses, errors, generator)
    own = np.random.default_rng([case.noise_seed, 1])
    single = [name for name in courses[0].channels if ":" not in name and name in CHANNELS]
    instruments: list[Gauge | _Image | _Film] = [Gauge(name, own) for name in single if name != "contact_width"]
    instruments += [_Image(case, seed, own), _Film(own)]
    found = []
    for recording, course, gap in zip(recordings, courses, above, strict=True):
        rate = float(course.displacement[1] - course.displacement[0]) / float(course.time[1] - course.time[0])
        channels = (one.read(recording, course, float(gap) / rate) for one in instruments)
        found.append(replace(recording, channels=tuple(one for one in channels if one is not None)))
    return found


def _frames(recording: Recording, course: Course, late: float, hertz: float) -> tuple[FloatArray, FloatArray]:
    """Return times of frames, and where in the course those are."""
    time = np.arange(0.1, float(recording.time[-1]), 1 / hertz)
    return time, np.clip(time - late, 0.0, course.time[-1])


def _heavy(shape: tuple[int, ...], generator: np.random.Generator) -> FloatArray:
    """Return errors of unit variance with heavy tails."""
    return np.asarray(generator.standard_t(_HEAVY, shape) / np.sqrt(_HEAVY / (_HEAVY - 2)))


class Gauge:
    """What has one reading a time: its errors that stay, and those of each trial."""

    def __init__(self, name: str, generator: np.random.Generator) -> None:
        self.name, self._generator = name, generator
        draw = generator.uniform
        self._crosstalk = self._gain = 0.0
        if name == "lateral_force":
            self._sd, self._bias, self._lag, self._step = 0.02, draw(-0.05, 0.05), 0.02, 0.0
            self._crosstalk, self._wander = draw(-0.02, 0.02), 0.03
        elif name.endswith("thickness"):
            self._sd, self._bias, self._lag, self._step = draw(0.3, 0.6), draw(-0.5, 0.5), draw(0.0, 0.3), 0.1
            self._gain, self._wander = draw(-0.03, 0.03), 0.1
        else:
            self._sd, self._bias, self._lag, self._step = 0.3, draw(-0.4, 0.4), draw(0.0, 0.1), 0.1
            self._wander = 0.3

    def read(self, recording: Recording, course: Course, late: float) -> RecordedChannel | None:
        """Return what it reads in a trial whose first touch is so late (s)."""
        time, at = _frames(recording, course, late + self._lag, FRAMES_HZ)

        def true(values: FloatArray) -> FloatArray:
            return np.asarray(np.interp(at, course.time, values))

        value = (1 + self._gain) * true(course.channels[self.name]) + self._crosstalk * true(course.force) + self._bias
        value += self._sd * _heavy(value.shape, self._generator) + self._wander * flicker(len(time), self._generator)
        if self._step:
            value = self._step * np.round(value / self._step)
        return RecordedChannel(self.name, time, value, CHANNELS[self.name].usual)


class _Image:
    """Displacements of points inside the section, as tracked in an image."""

    def __init__(self, case: SealedCase, seed: int, generator: np.random.Generator) -> None:
        self._points = points_of(case.leg, seed)
        ways = laid(case.leg, seed)
        self._turn = case.number % len(ways)
        self._laid, self._generator = ways[self._turn], generator
        self._lag, self._gain = generator.uniform(0.0, 0.2), generator.uniform(-0.03, 0.03)
        self._sd, self._drift = generator.uniform(0.2, 0.4), generator.uniform(0.05, 0.15)
        apart = np.linalg.norm(self._points[:, None] - self._points, axis=-1)
        alike = np.exp(-0.5 * (apart / _ALIKE_MM) ** 2) + 1e-6 * np.eye(len(self._points))
        self._lower = np.linalg.cholesky(alike)

    def read(self, recording: Recording, course: Course, late: float) -> RecordedChannel | None:
        n = len(self._points)
        names = [f"{INSIDE}:{2 * n * self._turn + k}" for k in range(2 * n)]
        if not n or any(name not in course.channels for name in names):
            return None
        time, at = _frames(recording, course, late + self._lag, FRAMES_HZ_AT_PLACES)
        moves = np.column_stack([np.interp(at, course.time, course.channels[name]) for name in names])
        seen = (1 + self._gain) * self._laid.seen(moves.reshape(-1, n, 2))
        # What is alike nearby is half of it; tracking loses its way slowly.
        own, shared = _heavy(seen.shape, self._generator), self._generator.standard_normal(seen.shape)
        seen += self._sd * np.sqrt(0.5) * (own + np.einsum("ij,tjw->tiw", self._lower, shared))
        for k in range(n):
            for way in (0, 1):
                seen[:, k, way] += self._drift * flicker(len(time), self._generator)
        course_of = np.tile(np.arange(2 * n), len(time))
        places = places_of(self._points)
        values, times = seen.reshape(-1), np.repeat(time, 2 * n)
        return RecordedChannel(INSIDE, times, values, CHANNELS[INSIDE].usual, None, course_of, places)


class _Film:
    """Pressures on the cylinder's face."""

    def __init__(self, generator: np.random.Generator) -> None:
        self._generator = generator
        self._gain, self._creep = generator.uniform(-0.1, 0.1), generator.uniform(0.0, 0.08)
        self._each = 1 + 0.03 * generator.standard_normal(len(SENSELS_MM))
        self._lag = generator.uniform(0.0, 0.2)

    def read(self, recording: Recording, course: Course, late: float) -> RecordedChannel | None:
        m = len(SENSELS_MM)
        names = [f"{PRESSURE}:{k}" for k in range(m)]
        if any(name not in course.channels for name in names):
            return None
        time, at = _frames(recording, course, late + self._lag, FRAMES_HZ_AT_PLACES)
        true = np.column_stack([np.interp(at, course.time, course.channels[name]) for name in names])
        crept = 1 + self._creep * np.log10(1 + at)[:, None]
        read = (1 + self._gain) * self._each * crept * true + 0.4 * _heavy(true.shape, self._generator)
        read = 0.2 * np.round(read / 0.2)
        accuracy = CHANNELS[PRESSURE].usual
        told = (read >= (accuracy.threshold or 0.0)).ravel()
        which = np.tile(np.arange(m), len(time))[told]
        times = np.repeat(time, m)[told]
        return RecordedChannel(PRESSURE, times, read.ravel()[told], accuracy, None, which, SENSELS_MM)

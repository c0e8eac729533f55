"""Sealed recordings with channels: what is concealed, what the leg did, and how a lab saw it.

Loadings alone, which tell least by the force. Errors of the channels are wider and of other shapes than assumed:
thicknesses to 0.3 to 0.6 mm with heavy tails, a boundary that is off by up to 0.5 mm, in steps of 0.1 mm and up to
0.3 s late; the lateral force with a cross-talk of up to 2 % of the force along the travel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from legfem.channels.registry import CHANNELS
from legfem.common.units import FloatArray
from legfem.data import Recording
from legfem.data.recording import RecordedChannel
from legfem.inverse.predictor import LawName
from legfem.legs.correction import TabulatedCorrection
from studies.concealed.cases import SUBJECTS_OF_LEGS, Code, Kind, SealedCase, sealed_leg
from studies.concealed.forms import drawn_values
from studies.concealed.truth import Truths
from studies.lab.recording import Course, flicker, record
from studies.lab.stated import drawn_errors

FORCE_ALONE: tuple[str, ...] = ()
THICKNESSES = ("fat_thickness", "muscle_thickness")
SUBSETS = {
    "force alone": FORCE_ALONE,
    "lateral force": ("lateral_force",),
    "two thicknesses": THICKNESSES,
    "all": tuple(CHANNELS),
}
"""Channels beside the force that the same recordings are diagnosed with."""
C10_KPA = (0.6, 1.0)
FRAMES_HZ = 4.0

type Concealed = tuple[Kind, Code, tuple[str, ...], tuple[tuple[str, float], ...]]

CONCEALED: tuple[Concealed, ...] = (
    ("none", "felupe", (), ()),
    ("outside", "felupe", (), (("hard-lump", 1.3),)),
    ("single", "felupe", ("superficial-stiffness",), ()),
    ("single", "legfem", ("indenter-tilt",), ()),
    ("single", "felupe", ("fascia-stiffness",), ()),
    ("pair", "legfem", ("superficial-stiffness", "indenter-tilt"), ()),
    ("none", "legfem", (), ()),
    ("single", "felupe", ("contact-slip",), ()),
    ("outside", "legfem", (), (("frame", 1.0),)),
    ("single", "felupe", ("compressibility",), ()),
    ("single", "legfem", ("support-compliance",), ()),
    ("pair", "legfem", ("superficial-stiffness", "fascia-stiffness"), ()),
    ("single", "legfem", ("superficial-stiffness",), ()),
    ("single", "legfem", ("dermis",), ()),
    ("none", "felupe", (), ()),
    ("single", "felupe", ("support-compliance",), ()),
    ("pair", "legfem", ("superficial-stiffness", "support-compliance"), ()),
    ("single", "legfem", ("prestress",), ()),
    ("outside", "legfem", (), (("drop", 1.0),)),
    ("single", "legfem", ("fascia-stiffness",), ()),
    ("single", "legfem", ("contact-slip",), ()),
    ("pair", "legfem", ("indenter-tilt", "support-compliance"), ()),
    ("outside", "felupe", (), (("lump", 1.3),)),
    ("none", "legfem", (), ()),
)
"""Kind, code that solves it, effects of the library, and effects outside it; taken in turn."""
_LIKE = {"hard-lump": "uneven-muscle", "lump": "uneven-muscle"}
"""Mechanisms of the library that stand for what is outside it."""


def channel_cases(number: int, seed: int, leg: int) -> list[SealedCase]:
    """Return cases on one leg, the first so many of `CONCEALED` in turn."""
    law: LawName = SUBJECTS_OF_LEGS[leg % len(SUBJECTS_OF_LEGS)][1]
    found = []
    for k in range(number):
        kind, code, names, outside = CONCEALED[k % len(CONCEALED)]
        generator = np.random.default_rng([seed, 36, k])
        c10 = float(np.exp(generator.uniform(*np.log(C10_KPA))))
        c20 = 0.0 if law == "neo-hookean" else c10 * float(generator.uniform(0.4, 2.0))
        effects = tuple((name, drawn_values(name, code, law, c10, generator)) for name in names)
        noise = int(generator.integers(2**31))
        found.append(SealedCase(k, kind, leg, law, "ramps", code, c10, c20, effects, outside, noise))
    return found


def truths_of(names: SealedCase) -> tuple[str, ...]:
    """Return what a case's diagnosis should name: nothing of what has no mechanism."""
    return tuple(name for name, _ in names.effects) + tuple(_LIKE[name] for name, _ in names.outside if name in _LIKE)


def recorded_with_channels(courses: Sequence[Course], noise_seed: int) -> list[Recording]:
    """Return what a lab records of trials, further channels with it."""
    generator = np.random.default_rng(noise_seed)
    errors = replace(drawn_errors(generator), same_travel=False)
    # The same draws as the recordings begin with.
    air = np.random.default_rng(noise_seed)
    drawn_errors(air)
    above = air.uniform(0.0, 1.0, len(courses)) * errors.air
    recordings = record(courses, errors, generator)
    own = np.random.default_rng([noise_seed, 1])
    seen = {name: _Instrument(name, own) for name in courses[0].channels}
    found = []
    for recording, course, gap in zip(recordings, courses, above, strict=True):
        rate = float(course.displacement[1] - course.displacement[0]) / float(course.time[1] - course.time[0])
        channels = tuple(one.read(recording, course, float(gap) / rate) for one in seen.values())
        found.append(replace(recording, channels=channels))
    return found


class _Instrument:
    """One channel's instrument in a lab: its errors that stay, and those of each trial."""

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

    def read(self, recording: Recording, course: Course, late: float) -> RecordedChannel:
        """Return what it reads in a trial whose first touch is so late (s)."""
        time = np.arange(0.1, float(recording.time[-1]), 1 / FRAMES_HZ)
        at = np.clip(time - late - self._lag, 0.0, course.time[-1])

        def true(values: FloatArray) -> FloatArray:
            return np.asarray(np.interp(at, course.time, values))

        value = (1 + self._gain) * true(course.channels[self.name]) + self._crosstalk * true(course.force) + self._bias
        value += self._sd * self._generator.standard_t(5, len(time)) / np.sqrt(5 / 3)
        value += self._wander * flicker(len(time), self._generator)
        if self._step:
            value = self._step * np.round(value / self._step)
        return RecordedChannel(self.name, time, value, CHANNELS[self.name].usual)


def made(context: tuple[int, Path, TabulatedCorrection], case: SealedCase) -> list[Recording] | None:
    """Return a case's recordings; None where a solution stopped.

    Parameters
    ----------
    context
        Seed of the legs, folder of solutions, and the correction of a cylinder's ends.
    case
        What is concealed.
    """
    seed, folder, correction = context
    truth = Truths(sealed_leg(case.leg, seed).true, folder / "truth", correction).of(case)
    return None if truth is None else recorded_with_channels(truth.trials, case.noise_seed)

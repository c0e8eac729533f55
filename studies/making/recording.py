"""How a lab records a true course: air, gains, zeros, instruments with errors; from a course, or a path."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

from legfem.common.units import FloatArray
from legfem.data import Instrument, Recording

SAMPLING_HZ = 10.0
INSTRUMENT = Instrument(force_sd=0.03, displacement_sd=0.02)
"""What the data sheet states: white and slow errors of a reading."""
WHITE_SHARE = 0.4
"""Of the load cell's variance; the rest is slow."""
ENCODER_STEP_MM = 0.05
ZERO_N = 0.05
"""A trial's zero is up to this, either way."""
_WHITE_FREEDOM, _GAIN_FREEDOM = 5, 3
_SLOWEST_WAVES = 40


@dataclass(frozen=True, eq=False)
class Course:
    """What a leg truly did in one trial, from first touch on; arrays are (n,).

    Parameters
    ----------
    time
        s, rising from 0.
    displacement
        mm after first touch.
    force
        N.
    channels
        What else the lab sees, by name.
    """

    time: FloatArray
    displacement: FloatArray
    force: FloatArray
    channels: Mapping[str, FloatArray] = field(default_factory=dict)


def loading(force: Callable[[FloatArray], FloatArray], depth: float, rate: float) -> Course:
    """Return what a leg does of a force (N) at displacements (mm), pressed to a depth at a speed (mm/s)."""
    time = np.arange(0.0, depth / rate + 1e-9, 1 / SAMPLING_HZ)
    return Course(time, rate * time, force(rate * time))


@dataclass(frozen=True)
class LabErrors:
    """Sizes of a lab's errors.

    Parameters
    ----------
    gain_sd
        Of a trial's force, a share.
    air
        Greatest travel before first touch (mm); each trial's own.
    heavy
        Whether gains have Student's distribution of 3 degrees of freedom; else they are uniform.
    same_travel
        Whether the drive goes equally far in all trials, so that more air means less depth; else it
        goes equally deep.
    """

    gain_sd: float = 0.0
    air: float = 0.0
    heavy: bool = False
    same_travel: bool = False


def record(
    courses: Sequence[Course], errors: LabErrors, generator: np.random.Generator, instrument: Instrument = INSTRUMENT
) -> list[Recording]:
    """Return the trials' recordings."""
    air = generator.uniform(0.0, 1.0, len(courses)) * errors.air
    gains = 1.0 + errors.gain_sd * _standard(len(courses), errors.heavy, generator)
    zeros = generator.uniform(-ZERO_N, ZERO_N, len(courses))
    if errors.same_travel:
        travel = min(float(c.displacement.max()) + a for c, a in zip(courses, air, strict=True))
        courses = [shortened(c, travel - a) for c, a in zip(courses, air, strict=True)]
    found = []
    for k, (course, above, gain, zero) in enumerate(zip(courses, air, gains, zeros, strict=True)):
        rate = float(course.displacement[1] - course.displacement[0]) / float(course.time[1] - course.time[0])
        late = float(above) / rate
        time = np.arange(0.0, late + course.time[-1] + 1e-9, 1 / SAMPLING_HZ)
        since = time - late
        pressed = np.interp(since, course.time, course.displacement)
        displacement = np.where(since < 0, rate * since, pressed) + above
        force = np.where(since < 0, 0.0, np.interp(since, course.time, course.force))
        sd = instrument.force_sd
        t = generator.standard_t(_WHITE_FREEDOM, len(time)) / np.sqrt(_WHITE_FREEDOM / (_WHITE_FREEDOM - 2))
        force = gain * force + zero + sd * np.sqrt(WHITE_SHARE) * t
        force = force + sd * np.sqrt(1 - WHITE_SHARE) * flicker(len(time), generator)
        # Rounding makes an error of a step over the root of 12; the rest of what is stated wanders.
        rest = np.sqrt(max(instrument.displacement_sd**2 - ENCODER_STEP_MM**2 / 12, 0.0))
        displacement = displacement + rest * flicker(len(time), generator)
        offset = generator.uniform(0.0, ENCODER_STEP_MM)
        rounded = ENCODER_STEP_MM * np.round((displacement + offset) / ENCODER_STEP_MM) - offset
        found.append(Recording(time, rounded, force, f"trial{k + 1}"))
    return found


def shortened(course: Course, depth: float) -> Course:
    """Return a loading that ends at a depth (mm); other courses go all their way."""
    if np.argmax(course.displacement) < len(course.displacement) - 1:
        return course
    kept = course.displacement <= depth
    beside = {name: values[kept] for name, values in course.channels.items()}
    return Course(course.time[kept], course.displacement[kept], course.force[kept], beside)


def _standard(count: int, heavy: bool, generator: np.random.Generator) -> FloatArray:
    """Return numbers of unit variance that aren't normal."""
    if heavy:
        drawn = generator.standard_t(_GAIN_FREEDOM, count)
        return np.asarray(np.clip(drawn / np.sqrt(3.0), -3.0, 3.0))
    return np.asarray(generator.uniform(-np.sqrt(3.0), np.sqrt(3.0), count))


def flicker(count: int, generator: np.random.Generator) -> FloatArray:
    """Return slow noise of unit variance: waves whose power falls as one over their frequency."""
    waves = np.arange(1, min(_SLOWEST_WAVES, count // 2) + 1)
    size = 1.0 / np.sqrt(waves)
    size *= np.sqrt(2.0 / np.sum(size**2))
    phases = generator.uniform(0.0, 2 * np.pi, len(waves))
    # The period is longer than the recording, whose ends then needn't meet.
    at = np.arange(count) / (1.3 * count)
    return np.asarray(np.cos(2 * np.pi * np.outer(at, waves) + phases) @ size)


_WANDERING, _CORRELATION_MM = 0.5, 4.0
"""Of a path's variance, the share that wanders, and the displacement over which its correlation falls to 1/e."""


def record_path(
    displacement: FloatArray,
    force: FloatArray,
    rate: float,
    sampling: float,
    noise: Instrument,
    generator: np.random.Generator,
    trial: str,
) -> Recording:
    """Return the recording of a path walked at constant speed; errors are in part white, in part wander along it.

    Each channel's variance is the instrument's; a data sheet's accuracy covers wander (hysteresis,
    linearity) more than jitter.

    Parameters
    ----------
    displacement, force
        The true path, (n,), mm and N, in the order in which it is walked.
    rate
        mm/s.
    sampling
        Hz.
    noise
        Standard deviations of a reading.
    generator
        Of the noise.
    trial
        Name.
    """
    walked = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(displacement)))])
    time = np.arange(0.0, walked[-1] / rate + 0.5 / sampling, 1 / sampling)
    at = np.minimum(time * rate, walked[-1])
    decay = np.exp(-rate / sampling / _CORRELATION_MM)

    def error(sd: float) -> FloatArray:
        white = generator.normal(size=time.size) * np.sqrt(1 - _WANDERING)
        drive = generator.normal(size=time.size) * np.sqrt(1 - decay**2)
        drive[0] = generator.normal()
        wander = lfilter([1.0], [1.0, -decay], drive) * np.sqrt(_WANDERING)
        return sd * (white + wander)

    return Recording(
        time=time,
        displacement=np.interp(at, walked, displacement) + error(noise.displacement_sd),
        force=np.interp(at, walked, force) + error(noise.force_sd),
        trial=trial,
    )

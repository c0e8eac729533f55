"""What a case's leg really did, simulated on another discretisation, and how it was recorded.

The truth comes from a finer mesh, the exponential contact law, smaller steps and another quadrature
than the diagnosis uses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.signal import lfilter

from legfem.contact_settings import ContactSettings
from legfem.correction import TabulatedCorrection
from legfem.diagnose.diagnosis import mechanism_named
from legfem.diagnose.observations import Observations
from legfem.diagnose.predict import Predictor
from legfem.diagnose.solved import SolvedResponses
from legfem.diagnose.stations import Stations
from legfem.diagnose.variants import Variants
from legfem.protocol import Protocol
from legfem.recording import Recording
from legfem.recording.contact import contact_at_start
from legfem.recording.phases import HOLD
from legfem.stepping import StepSettings
from legfem.study.concealed.cases import SAMPLING_HZ, Case, protocols_of
from legfem.study.planted import TRUTH_SETTINGS as FINE
from legfem.subject import Subject
from legfem.units import FloatArray

TRUTH_SETTINGS = replace(
    FINE,
    contact=ContactSettings(normal="exponential", stiffness=2000.0, onset=0.02),
    steps=StepSettings(first=0.15, largest=1.2),
)
SLOW_S = 8.0
"""Time over which the load cell's slow error is correlated."""
WANDER_MM = 4.0
FORCE_SD_N, DISPLACEMENT_SD_MM = (0.009, 0.009), (0.005, 0.007)
"""White and slow part."""
GAIN_SD, ZERO_SD_N = 0.002, (0.0055, 0.0055)
"""The instruments' bias: gain and zero, the same in all trials of a case, and each trial's zero."""


def truth_responses(
    subject: Subject, depth: float, folder: Path, correction: TabulatedCorrection
) -> SolvedResponses:
    """Return a leg's responses on the truth's discretisation."""
    from legfem.experiments.plane_strain import tissues_of
    from legfem.identify.forward import PlaneStrainForward

    fingerprint = PlaneStrainForward.of_subject(subject, depth, TRUTH_SETTINGS).fingerprint()
    variants = Variants(subject.section, subject.indenter, tissues_of(subject), TRUTH_SETTINGS)
    own = {"model": "truth", "deep": repr(tissues_of(subject).deep)}
    return SolvedResponses(
        variants, depth, folder, {**fingerprint, **own}, of_another_leg(correction)
    )


def of_another_leg(correction: TabulatedCorrection) -> TabulatedCorrection:
    """Return a correction that is off by its own errors, the leg's unknown length among them."""
    return replace(correction, values=correction.values + sum(correction.errors.values()))


def dense_stations(protocol: Protocol) -> Stations:
    """Return a fine grid along a protocol, its start left out."""
    phase: list[str] = []
    segment: list[int] = []
    time: list[float] = []
    for number, part in enumerate(protocol.segments):
        count = 48 if part.phase == HOLD else 64
        fraction = (
            np.geomspace(0.002, 1.0, count)
            if part.phase == HOLD
            else np.linspace(0, 1, count + 1)[1:]
        )
        time += list(part.start + fraction * part.duration)
        phase += [part.phase] * count
        segment += [number] * count
    at = np.array(time)
    return Stations(protocol, np.array(phase), np.array(segment), protocol.displacement_at(at), at)


def blank_observations(protocols: Sequence[Protocol]) -> Observations:
    """Return observations of nothing at dense stations, one trial a protocol."""
    distinct = list(dict.fromkeys(protocols))
    stations = tuple(dense_stations(protocol) for protocol in distinct)
    numbers = tuple(distinct.index(protocol) for protocol in protocols)
    size = sum(len(stations[k].time) for k in numbers)
    nothing = np.zeros(size)
    return Observations(
        tuple(f"trial{k + 1}" for k in range(len(protocols))),
        stations,
        numbers,
        nothing,
        nothing,
        nothing,
        0.0,
        0.0,
        tuple(contact_at_start() for _ in protocols),
        (),
    )


@dataclass(frozen=True, eq=False)
class Truth:
    """Noise-free forces of all trials at dense stations."""

    observed: Observations
    force: FloatArray
    """(n,), N."""


def simulate(case: Case, responses: SolvedResponses, law: str) -> Truth:
    """Return what a case's leg did; NaN if a finite-element solution stopped."""
    blank = blank_observations(protocols_of(case.protocol))
    values = {"C10": case.c10_kpa, "C20": case.c20_kpa}
    mechanisms = []
    for name, own in case.effects:
        mechanisms.append(mechanism_named(name))
        values |= {f"{name}.{key}": value for key, value in own}
    predictor = Predictor(blank, responses, law)  # type: ignore[arg-type]
    force = predictor(values, mechanisms)
    for name, size in case.outside:
        force = _OUTSIDE[name](blank, force, size)
    return Truth(blank, force)


def record(truth: Truth, case: Case) -> list[Recording]:
    """Return the trials' recordings, with errors of the instruments."""
    generator = np.random.default_rng(case.noise_seed)
    gain = 1.0 + GAIN_SD * generator.normal()
    zero = ZERO_SD_N[0] * generator.normal()
    recordings = []
    for k, name in enumerate(truth.observed.trials):
        here = truth.observed.trial == k
        protocol = truth.observed.protocols[truth.observed.protocol_of[k]].protocol
        time = np.arange(0.0, protocol.duration + 0.5 / SAMPLING_HZ, 1 / SAMPLING_HZ)
        force = force_at(truth, k, time) * gain + zero + ZERO_SD_N[1] * generator.normal()
        step = 1 / SAMPLING_HZ
        rate = abs(np.gradient(protocol.displacement_at(time), time)).max()
        force = force + _error(len(time), *FORCE_SD_N, step / SLOW_S, generator)
        displacement = protocol.displacement_at(time) + _error(
            len(time), *DISPLACEMENT_SD_MM, rate * step / WANDER_MM, generator
        )
        recordings.append(Recording(time, displacement, force, name))
        assert here.any()
    return recordings


def force_at(truth: Truth, trial: int, time: FloatArray) -> FloatArray:
    """Return a trial's true force at times (s), segment by segment."""
    observed = truth.observed
    here = np.flatnonzero(observed.trial == trial)
    stations = observed.protocols[observed.protocol_of[trial]]
    result = np.zeros(len(time))
    before_t, before_f = 0.0, 0.0
    for number, part in enumerate(stations.protocol.segments):
        own = here[stations.segment == number]
        t = np.concatenate([[before_t], observed.time[own]])
        f = np.concatenate([[before_f], truth.force[own]])
        inside = (time >= part.start) & (time <= part.end + 1e-9)
        result[inside] = PchipInterpolator(t, f)(np.clip(time[inside], t[0], t[-1]))
        before_t, before_f = float(t[-1]), float(f[-1])
    return result


def _error(
    count: int, white: float, slow: float, step: float, generator: np.random.Generator
) -> FloatArray:
    decay = np.exp(-step)
    drive = generator.normal(size=count) * np.sqrt(1 - decay**2)
    drive[0] = generator.normal()
    return white * generator.normal(size=count) + slow * lfilter([1.0], [1.0, -decay], drive)


def _ripple(observed: Observations, force: FloatArray, size: float) -> FloatArray:
    """Return the force of a drive whose thread is out of true: a ripple over its pitch."""
    moving = observed.phase != HOLD
    return force + 0.15 * size * np.sin(2 * np.pi * observed.displacement / 3.0) * moving


def _drop(observed: Observations, force: FloatArray, size: float) -> FloatArray:
    """Return the force that falls at a depth and stays lower: something came loose."""
    after = np.zeros(len(force), dtype=bool)
    for k in range(len(observed.trials)):
        here = np.flatnonzero(observed.trial == k)
        first = here[np.argmax(observed.displacement[here] > 11.0)]
        after[first : here[-1] + 1] = True
    return force - 0.25 * size * after


def _clipping(observed: Observations, force: FloatArray, size: float) -> FloatArray:
    """Return the force of an amplifier that saturates."""
    return np.minimum(force, (1.0 - 0.06 * size) * force.max())


def _leg_shift(observed: Observations, force: FloatArray, size: float) -> FloatArray:
    """Return the force of a leg that moves away and comes back: a bump in time."""
    bump = np.exp(-(((observed.displacement - 13.0) / 1.2) ** 2)) * (observed.phase == "loading")
    return force - 0.3 * size * bump


_OUTSIDE = {
    "ripple": _ripple,
    "drop": _drop,
    "clipping": _clipping,
    "leg-shift": _leg_shift,
}

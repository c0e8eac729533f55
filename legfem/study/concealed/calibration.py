"""Whether p-values are what they say, and how large an effect has to be to be found.

Recordings without any effect are emulated: the library's forces with the instruments' errors, as
sealed cases are recorded.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import kstest, norm

from legfem.diagnose.choose import MISMATCH
from legfem.diagnose.diagnosis import starts
from legfem.diagnose.fit import Fit, Problem, fit_base
from legfem.diagnose.library import Library, tested_mechanisms
from legfem.diagnose.mechanisms import Mechanism
from legfem.diagnose.noise import (
    NUMERICAL_ERROR,
    NUMERICAL_LENGTH_MM,
    ROUGHNESS,
    ROUGHNESS_LENGTH_MM,
    estimate_noise,
)
from legfem.diagnose.observations import Observations, observe
from legfem.diagnose.predict import LawName, Predictor
from legfem.diagnose.score import assess, signatures_of
from legfem.study.concealed.cases import (
    C10_KPA,
    INSTRUMENT,
    RATIO,
    Case,
    ProtocolName,
    protocols_of,
)
from legfem.study.concealed.truth import Truth, blank_observations, record
from legfem.units import FloatArray

_WAVES = 400


@dataclass(frozen=True)
class Emulated:
    """A recording without effect, to be emulated."""

    library: Library
    law: LawName
    protocol: ProtocolName
    seed: int


def emulated_recordings(task: Emulated) -> tuple[Observations, Case]:
    """Return recordings emulated without effect, and their case.

    The model's own error is drawn too, as large as the diagnosis takes it to be: where it is
    smaller, p-values are cautious.
    """
    generator = np.random.default_rng([task.seed, 5])
    c10 = float(np.exp(generator.uniform(*np.log(C10_KPA))))
    c20 = 0.0 if task.law == "neo-hookean" else c10 * float(generator.uniform(*RATIO))
    case = Case(
        0, "none", "", task.law, task.protocol, c10, c20, (), (), int(generator.integers(2**31))
    )
    blank = blank_observations(protocols_of(task.protocol))
    force = Predictor(blank, task.library, task.law)({"C10": c10, "C20": c20})
    at = blank.displacement
    force = force * (1 + NUMERICAL_ERROR * _smooth(at, NUMERICAL_LENGTH_MM, generator))
    force += ROUGHNESS * force.max() * _smooth(at, ROUGHNESS_LENGTH_MM, generator)
    return observe(record(Truth(blank, force), case), INSTRUMENT, starts_at_contact=True), case


def _smooth(at: FloatArray, length: float, generator: np.random.Generator) -> FloatArray:
    """Return a smooth random function of unit variance: many waves of random length and phase."""
    waves = generator.normal(size=(_WAVES, 1)) / length
    phases = generator.uniform(0, 2 * np.pi, size=(_WAVES, 1))
    return np.asarray(np.sqrt(2 / _WAVES) * np.cos(waves * at + phases).sum(axis=0))


def _tested(task: Emulated) -> tuple[Problem, Fit, list[Mechanism]]:
    """Return an emulated recording's problem, its base fit and the mechanisms to test."""
    observed, _ = emulated_recordings(task)
    able, _ = tested_mechanisms(observed, task.library)
    predictor = Predictor(observed, task.library, task.law)
    problem, base = fit_base(predictor, *estimate_noise(observed, INSTRUMENT), starts(task.law))
    return problem, base, able


def null_p_values(task: Emulated) -> tuple[float, float]:
    """Return the p-value that the verdict rests on, and the family-wise one of the windows."""
    problem, base, able = _tested(task)
    found = assess(problem, base, able, task.seed)
    return found.p_value, found.windows_p_value


@dataclass(frozen=True)
class Calibration:
    """Of a p-value over recordings without effect."""

    p_values: FloatArray
    """(n,)."""

    @property
    def uniform(self) -> float:
        """p-value of Kolmogorov and Smirnov's test that they are uniform."""
        return float(kstest(self.p_values, "uniform").pvalue)

    @property
    def alarms(self) -> float:
        """Share below the limit that a mismatch is called at."""
        return float(np.mean(self.p_values < MISMATCH))


@dataclass(frozen=True)
class Calibrated:
    """Calibration and detection on the study's legs."""

    verdict: Calibration
    """The p-value that the verdict rests on."""
    windows: Calibration
    """The family-wise p-value of the strongest window."""
    smallest: Mapping[str, Mapping[str, list[float]]]
    """Strength found at 80 % power by mechanism and protocol, one a leg."""

    def document(self) -> dict[str, Any]:
        """Return it as JSON types."""
        return {
            "schema": 1,
            "origin": "emulated",
            "p_values": {
                name: {
                    "values": own.p_values.tolist(),
                    "uniform_p_value": own.uniform,
                    "alarms": own.alarms,
                }
                for name, own in (("verdict", self.verdict), ("windows", self.windows))
            },
            "smallest_effect_at_80_percent_power": {
                name: dict(found) for name, found in self.smallest.items()
            },
        }


def smallest_effects(task: Emulated, power: float = 0.8) -> Mapping[str, float]:
    """Return the strength of each mechanism that is found with a power.

    The score statistic's square root is normal with mean strength times the length of the projected
    signature; the limit is that of the family of all mechanisms (Bonferroni) at the verdict's.
    """
    problem, base, able = _tested(task)
    found, _ = signatures_of(problem, base, able)
    limit = float(norm.isf(MISMATCH / 2 / len(able)))
    needed = limit + float(norm.ppf(power))
    strengths: dict[str, float] = {}
    for signature in found:
        strength = needed / float(np.linalg.norm(signature.direction))
        name = signature.mechanism.name
        strengths[name] = min(strength, strengths.get(name, np.inf))
    return strengths

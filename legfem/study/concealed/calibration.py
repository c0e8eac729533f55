"""Whether p-values are what they say, on emulated recordings.

These are the library's forces with the model's and the instruments' errors, as sealed cases are
recorded.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import kstest

from legfem.diagnose.choose import MISMATCH
from legfem.diagnose.diagnosis import mechanism_named, starts
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
from legfem.diagnose.score import assess
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
    """A recording to be emulated."""

    library: Library
    law: LawName
    protocol: ProtocolName
    seed: int
    effect: tuple[str, float] | None = None
    """A mechanism and its strength, its shape in the middle of those that are tried."""


def emulated_recordings(task: Emulated) -> Observations:
    """Return emulated recordings at their stations.

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
    values = {"C10": c10, "C20": c20}
    force = Predictor(blank, task.library, task.law)(values)
    at = blank.displacement
    force = force * (1 + NUMERICAL_ERROR * _smooth(at, NUMERICAL_LENGTH_MM, generator))
    force += ROUGHNESS * force.max() * _smooth(at, ROUGHNESS_LENGTH_MM, generator)
    observed = observe(record(Truth(blank, force), case), INSTRUMENT, starts_at_contact=True)
    if task.effect is None:
        return observed
    # The library knows an effect at the stations alone.
    name, strength = task.effect
    mechanism = mechanism_named(name)
    shapes = mechanism.shape_choices(observed)
    own = {**shapes[len(shapes) // 2], mechanism.parameters[0].name: strength}
    changed = {**values, **{f"{name}.{key}": value for key, value in own.items()}}
    predictor = Predictor(observed, task.library, task.law)
    return observed.with_force(observed.force + predictor(changed, [mechanism]) - predictor(values))


def _smooth(at: FloatArray, length: float, generator: np.random.Generator) -> FloatArray:
    """Return a smooth random function of unit variance: many waves of random length and phase."""
    waves = generator.normal(size=(_WAVES, 1)) / length
    phases = generator.uniform(0, 2 * np.pi, size=(_WAVES, 1))
    return np.asarray(np.sqrt(2 / _WAVES) * np.cos(waves * at + phases).sum(axis=0))


def tested(task: Emulated) -> tuple[Problem, Fit, list[Mechanism]]:
    """Return an emulated recording's problem, its base fit and the mechanisms to test."""
    observed = emulated_recordings(task)
    able, _ = tested_mechanisms(observed, task.library)
    predictor = Predictor(observed, task.library, task.law)
    problem, base = fit_base(predictor, *estimate_noise(observed, INSTRUMENT), starts(task.law))
    return problem, base, able


def null_p_values(task: Emulated) -> tuple[float, float]:
    """Return the p-value that the verdict rests on, and the family-wise one of the windows."""
    problem, base, able = tested(task)
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
    """Calibration on the study's legs."""

    verdict: Calibration
    """The p-value that the verdict rests on."""
    windows: Calibration
    """The family-wise p-value of the strongest window."""

    def document(self) -> dict[str, Any]:
        """Return it as JSON types."""
        return {
            "schema": 2,
            "origin": "emulated",
            "p_values": {
                name: {
                    "values": own.p_values.tolist(),
                    "uniform_p_value": own.uniform,
                    "alarms": own.alarms,
                }
                for name, own in (("verdict", self.verdict), ("windows", self.windows))
            },
        }

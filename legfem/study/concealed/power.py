"""Detection power against effect size, counted on emulated recordings.

A strength is given in multiples of the one that a linear estimate finds with 80 % power in the same
leg, so that legs and stiffnesses can be counted together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.stats import norm

from legfem.diagnose.choose import MISMATCH
from legfem.diagnose.diagnosis import mechanism_named
from legfem.diagnose.score import assess, signatures_of
from legfem.study.concealed.calibration import Emulated, tested
from legfem.study.concealed.cases import ProtocolName
from legfem.units import FloatArray

RATIOS = (0.5, 0.8, 1.25, 2.0)
"""Strengths over the linear estimate."""
POWER = 0.8


@dataclass(frozen=True)
class Trial:
    """One recording with an effect, to be emulated."""

    emulated: Emulated
    mechanism: str
    ratio: float

    @property
    def name(self) -> str:
        """By which its outcome is kept."""
        return f"{self.emulated.protocol} {self.emulated.seed} {self.mechanism} {self.ratio:g}"


@dataclass(frozen=True)
class Tried:
    """What came of it."""

    strength: float
    """In the mechanism's unit."""
    found: bool | None
    """Whether a mismatch was called; None if the mechanism can't be so strong."""


@lru_cache(maxsize=64)
def linear_estimate(emulated: Emulated) -> dict[str, float]:
    """Return the strength of each mechanism that is found with 80 % power, by the middle shape.

    The score statistic's square root is normal with mean strength times the length of the projected
    signature; the limit is that of the family of all mechanisms (Bonferroni) at the verdict's.
    """
    problem, base, able = tested(emulated)
    limit = float(norm.isf(MISMATCH / 2 / len(able)))
    needed = limit + float(norm.ppf(POWER))
    found, _ = signatures_of(problem, base, able)
    middle = {m.name: m.shape_choices(problem.predictor.observed) for m in able}
    return {
        s.mechanism.name: needed / float(np.linalg.norm(s.direction))
        for s in found
        if s.shape == middle[s.mechanism.name][len(middle[s.mechanism.name]) // 2]
    }


def try_effect(trial: Trial) -> Tried | None:
    """Emulate a recording with the effect and test it; None where it isn't testable."""
    name = trial.mechanism
    strength = trial.ratio * linear_estimate(trial.emulated).get(name, np.nan)
    if not np.isfinite(strength):
        return None
    first = mechanism_named(name).parameters[0]
    if first.null + strength > first.high:
        return Tried(strength, None)
    problem, base, able = tested(replace(trial.emulated, effect=(name, first.null + strength)))
    return Tried(strength, assess(problem, base, able, trial.emulated.seed).p_value < MISMATCH)


@dataclass(frozen=True)
class PowerCurve:
    """How often a mechanism was found, against its strength over the linear estimate."""

    mechanism: str
    protocol: ProtocolName
    ratios: FloatArray
    """(n,), of recordings."""
    strengths: FloatArray
    """(n,), in the mechanism's unit."""
    found: FloatArray
    """(n,), 0 or 1."""
    out_of_reach: int
    """Recordings in which the mechanism would have to be stronger than it can be."""

    def counted(self, ratio: float) -> tuple[int, int]:
        """Return how many were found of how many at a ratio."""
        here = np.isclose(self.ratios, ratio)
        return int(self.found[here].sum()), int(here.sum())

    @cached_property
    def probit(self) -> tuple[float, float]:
        """Middle (in ln of the ratio) and width of the fitted curve, by maximum likelihood.

        The width is held between 0.1 and 1, since all or none may be found.
        """
        x = np.log(self.ratios)

        def cost(at: FloatArray) -> float:
            z = (x - at[0]) / at[1]
            return -float(np.sum(norm.logcdf(np.where(self.found > 0, z, -z))))

        fitted = minimize(cost, [0.0, 0.3], bounds=[(-2.0, 2.0), (0.1, 1.0)], method="L-BFGS-B")
        return float(fitted.x[0]), float(fitted.x[1])

    def power(self, ratio: FloatArray) -> FloatArray:
        """Return the fitted share that is found."""
        middle, width = self.probit
        return np.asarray(norm.cdf((np.log(ratio) - middle) / width))

    @property
    def ratio_found(self) -> float | None:
        """Ratio found at 80 % power; None beyond the strengths that were tried."""
        middle, width = self.probit
        ratio = float(np.exp(middle + width * norm.ppf(POWER)))
        return ratio if len(self.ratios) and RATIOS[0] / 1.5 < ratio < RATIOS[-1] * 1.5 else None

    @property
    def smallest(self) -> tuple[float, float] | None:
        """Range over legs and stiffnesses of the strength found at 80 % power."""
        if self.ratio_found is None:
            return None
        found = self.ratio_found * self.strengths / self.ratios
        return float(np.percentile(found, 10)), float(np.percentile(found, 90))

    def document(self) -> dict[str, Any]:
        """Return it as JSON types."""
        return {
            "mechanism": self.mechanism,
            "protocol": self.protocol,
            "counted": {str(ratio): self.counted(ratio) for ratio in RATIOS},
            "out_of_reach": self.out_of_reach,
            "ratio_at_80_percent": self.ratio_found,
            "strength_at_80_percent": self.smallest,
        }


def power_curve(
    mechanism: str, protocol: ProtocolName, outcomes: Sequence[tuple[Trial, Tried]]
) -> PowerCurve:
    """Return the curve of a mechanism's recordings."""
    done = [(trial.ratio, tried) for trial, tried in outcomes if tried.found is not None]
    return PowerCurve(
        mechanism,
        protocol,
        np.array([ratio for ratio, _ in done]),
        np.array([tried.strength for _, tried in done]),
        np.array([float(bool(tried.found)) for _, tried in done]),
        len(outcomes) - len(done),
    )

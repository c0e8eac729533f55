"""Mechanisms that change the deep tissue's stiffness from time to time or trial to trial."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from legfem.diagnose.mechanisms.base import Mechanism, Parameter, Values
from legfem.diagnose.observations import Observations
from legfem.units import FloatArray


@dataclass(frozen=True)
class MuscleContraction(Mechanism):
    """The muscle tenses from a moment on, in every trial: a smooth switch of its stiffness.

    An elastic leg's force at a displacement follows from the stiffness then, so no history is
    needed; `legfem.terms.contraction` is the same thing in the finite-element model.
    """

    name: ClassVar[str] = "muscle-contraction"
    statement: ClassVar[str] = "the muscle tensed during the test and became stiffer"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("stiffening", "-", "rise of the deep stiffness over itself", 0.0, 3.0, start=0.1),
        Parameter("onset", "s", "when it begins", 0.0, 1e4),
        Parameter("rise", "s", "how long it takes to rise", 0.05, 1e4),
    )
    next_experiment: ClassVar[str] = (
        "repeat with electromyography of the calf, or ask for a relaxed leg and compare"
    )

    def shape_choices(self, observed: Observations) -> tuple[Values, ...]:
        """Return onsets through the shortest protocol and two times of rising."""
        end = min(float(s.protocol.time[-1]) for s in observed.protocols)
        return tuple(
            {"onset": part * end, "rise": share * end}
            for part in np.linspace(0.15, 0.85, 15)
            for share in (0.03, 0.1)
        )

    def deep_factor(self, values: Values, observed: Observations) -> FloatArray:
        """Return the stiffness over that at rest."""
        return 1.0 + values["stiffening"] * smooth_switch(
            (observed.time - values["onset"]) / max(values["rise"], 1e-6)
        )


def smooth_switch(fraction: FloatArray) -> FloatArray:
    """Return 0 below 0, 1 above 1 and 3 x^2 - 2 x^3 between."""
    x = np.clip(fraction, 0.0, 1.0)
    return np.asarray(x * x * (3 - 2 * x))


@dataclass(frozen=True)
class Preconditioning(Mechanism):
    """The deep tissue softens from trial to trial towards a state, half the way each time.

    The reference is the last trial: at the null all trials are alike.
    """

    name: ClassVar[str] = "preconditioning"
    statement: ClassVar[str] = (
        "the tissue softened from one trial to the next: it was not preconditioned"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("softening", "-", "excess stiffness of the first trial", -0.5, 1.5, start=0.1),
    )
    next_experiment: ClassVar[str] = (
        "cycle five to ten times before recording, and rest between trials"
    )

    def untestable(self, observed: Observations) -> str | None:
        """Return whether there are repeats."""
        if observed.repeats < 2:
            return "it shows in repeats of one protocol, and there are none"
        return None

    def deep_factor(self, values: Values, observed: Observations) -> FloatArray:
        """Return each trial's stiffness over the settled one."""
        return np.asarray(1.0 + values["softening"] * 0.5 ** observed.trial.astype(float))

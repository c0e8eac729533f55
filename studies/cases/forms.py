"""The forms of concealed effects, which mostly aren't the diagnosis' own.

Some belong into the finite-element model (`studies.cases.truth`); those here act on a trial's
course: on its force, the displacement and the time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from legfem.common.units import FloatArray

BRANCHES_S = (0.6, 5.0, 40.0, 300.0)
"""Relaxation times of the truth's spectrum; none is one of the diagnosis' model."""


FORMS: Mapping[str, tuple[tuple[float, float], Mapping[str, tuple[float, float]]]] = {
    # Four branches, their shares a power of time; the ratio.
    "viscoelasticity": ((0.05, 0.4), {"power": (0.0, 0.3)}),
    # mm4/(N s), the skeleton's share.
    "poroelastic-drainage": ((50.0, 1500.0), {"skeleton": (0.01, 0.1)}),
    "fascia-stiffness": ((6.0, 20.0), {}),
    "superficial-stiffness": ((1.8, 3.5), {}),
    # Shear modulus times thickness, N/mm.
    "dermis": ((0.1, 1.0), {}),
    # Degrees.
    "indenter-tilt": ((6.0, 14.0), {}),
    # Factor on D1.
    "compressibility": ((9.0, 26.0), {}),
    # kPa.
    "prestress": ((80.0, 250.0), {}),
    # A face of its own, which its two sides slide along freely.
    "fat-sliding": ((0.999, 1.0), {}),
    # Coulomb's friction.
    "contact-slip": ((0.03, 0.25), {}),
    # mm/N: a series spring that hardens; felupe: each bone on springs.
    "support-compliance": ((0.15, 0.7), {"hardening": (0.02, 0.15)}),
    # An excess of the first trial that falls with depth and fades from trial to trial.
    "preconditioning": ((0.05, 0.2), {"fading": (0.1, 0.6), "grading": (-0.4, 0.4)}),
    # A tension that rises, then gives way by a third.
    "muscle-contraction": ((0.04, 0.2), {"onset": (0.2, 0.7), "rise": (0.03, 0.15)}),
    # N: a load cell that warms up and levels off.
    "force-drift": ((0.15, 0.6), {"time": (15.0, 80.0)}),
}
"""Range of an effect's first number, drawn evenly in the logarithm, and of its others, drawn evenly."""


def drawn_values(name: str, generator: np.random.Generator) -> tuple[tuple[str, float], ...]:
    """Return an effect's numbers, its strength first."""
    strengths, others = FORMS[name]
    strength = float(np.exp(generator.uniform(*np.log(strengths))))
    return (("strength", strength), *((key, float(generator.uniform(*ends))) for key, ends in others.items()))


@dataclass(frozen=True, eq=False)
class Pressed:
    """A trial as an effect on its course sees it; arrays are (n,)."""

    trial: int
    time: FloatArray
    """s since first touch."""
    displacement: FloatArray
    force: FloatArray
    """N, with what is in the finite-element model."""
    elastic: Callable[[FloatArray], FloatArray]
    """The leg's elastic force at displacements."""

    @property
    def depth(self) -> float:
        """Mm."""
        return float(self.displacement.max())


def _preconditioning(trial: Pressed, v: Mapping[str, float]) -> FloatArray:
    graded = 1.0 + v["grading"] * np.cos(np.pi * trial.displacement / trial.depth)
    return trial.force * (1.0 + v["strength"] * v["fading"] ** trial.trial * graded)


def _in_series(trial: Pressed, taken: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Return the force where something takes up a part of the way (mm), by the force."""
    pressed = np.linspace(0.0, trial.depth, 600)
    force = trial.elastic(pressed)
    less = np.interp(trial.displacement, pressed + taken(force), force)
    whole = np.maximum(trial.elastic(trial.displacement), 1e-9)
    return np.asarray(trial.force * np.where(trial.displacement > 0, less / whole, 1.0))


def _support(trial: Pressed, v: Mapping[str, float]) -> FloatArray:
    """Return the force on a spring that hardens."""
    return _in_series(trial, lambda force: v["strength"] * force / (1.0 + v["hardening"] * force))


def _contraction(trial: Pressed, v: Mapping[str, float]) -> FloatArray:
    whole = trial.time[-1]
    since = (trial.time / whole - v["onset"]) / v["rise"]
    risen = 0.5 * (1 - np.cos(np.pi * np.clip(since, 0.0, 1.0)))
    tired = 1.0 - np.clip(since - 1.0, 0.0, None) / (3.0 + np.clip(since - 1.0, 0.0, None)) / 3
    return np.asarray(trial.force * (1.0 + v["strength"] * risen * tired))


def _drift(trial: Pressed, v: Mapping[str, float]) -> FloatArray:
    return np.asarray(trial.force + v["strength"] * (1.0 - np.exp(-trial.time / v["time"])))


ON_COURSE: Mapping[str, Callable[[Pressed, Mapping[str, float]], FloatArray]] = {
    "support-compliance": _support,
    "preconditioning": _preconditioning,
    "muscle-contraction": _contraction,
    "force-drift": _drift,
}
"""In the order in which they act."""


def _drop(trial: Pressed, size: float) -> FloatArray:
    after = np.arange(len(trial.time)) >= np.argmax(trial.displacement > 11.0)
    return np.asarray(trial.force - 0.04 * size * trial.force.max() * after)


def _clipping(trial: Pressed, size: float) -> FloatArray:
    return np.minimum(trial.force, (1.0 - 0.08 * size) * trial.force.max())


def _rig_bends(trial: Pressed, size: float) -> FloatArray:
    """Return the force where the rig gives way the more easily the harder it is pressed."""
    return _in_series(trial, lambda force: 0.12 * size * force * (1.0 + force / force.max()))


def _twitch(trial: Pressed, size: float) -> FloatArray:
    """Return the force of a muscle that tenses and lets go in the second trial."""
    since = (trial.time / trial.time[-1] - 0.45) / 0.08
    return np.asarray(trial.force * (1.0 + 0.15 * size * np.exp(-(since**2)) * (trial.trial == 1)))


def _frame(trial: Pressed, size: float) -> FloatArray:
    beyond = np.maximum(trial.displacement - 14.0, 0.0) / (trial.depth - 14.0)
    return np.asarray(trial.force - 0.08 * size * trial.force.max() * beyond)


OUTSIDE_ON_COURSE: Mapping[str, Callable[[Pressed, float], FloatArray]] = {
    "drop": _drop,
    "clipping": _clipping,
    "frame": _frame,
    "rig-bends": _rig_bends,
    "twitch": _twitch,
}

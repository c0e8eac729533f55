"""The forms of concealed effects, which mostly aren't the diagnosis' own.

Some belong into the finite-element model (`studies.concealed.truth`); those here act on a trial's
course: on its force, the displacement and the time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from legfem.common.units import FloatArray

BRANCHES_S = (0.6, 5.0, 40.0, 300.0)
"""Relaxation times of the truth's spectrum; none is one of the diagnosis' model."""


@dataclass(frozen=True)
class Form:
    """How an effect is concealed.

    Parameters
    ----------
    strengths
        Range of its first number, drawn evenly in the logarithm.
    statement
        Its form.
    number
        Name and unit of the first number.
    needs_time
        Whether it shows in holds and unloading only.
    others
        Ranges of its other numbers, drawn evenly.
    """

    strengths: tuple[float, float]
    statement: str
    number: str
    needs_time: bool = False
    others: Mapping[str, tuple[float, float]] = field(default_factory=dict)


FORMS: Mapping[str, Form] = {
    "viscoelasticity": Form(
        (0.05, 0.4), "four branches, their shares a power of time", "ratio", True, {"power": (0.0, 0.3)}
    ),
    "superficial-viscoelasticity": Form((0.2, 0.8), "the same of the fat", "ratio", True, {"power": (0.0, 0.3)}),
    "poroelastic-drainage": Form(
        (50.0, 1500.0), "the diagnosis' form", "permeability, mm4/(N s)", True, {"skeleton": (0.01, 0.1)}
    ),
    "strain-stiffening": Form(
        (0.6, 2.5),
        "the law's next coefficient (the diagnosis' form); felupe: exponential",
        "coefficient, kPa",
        False,
        {"beta": (0.4, 1.5)},
    ),
    "fascia-stiffness": Form((6.0, 20.0), "the diagnosis' form", "factor"),
    "superficial-stiffness": Form((1.8, 3.5), "the diagnosis' form", "factor"),
    "superficial-stiffening": Form((2.0, 15.0), "the diagnosis' form", "coefficient, kPa"),
    "dermis": Form((0.1, 1.0), "the diagnosis' form", "shear modulus times thickness, N/mm"),
    "indenter-tilt": Form((6.0, 14.0), "the diagnosis' form", "angle, degrees"),
    "compressibility": Form((9.0, 26.0), "the diagnosis' form", "factor on D1"),
    "prestress": Form((80.0, 250.0), "the diagnosis' form", "tension, kPa"),
    "fat-sliding": Form((0.999, 1.0), "a face of its own, which its two sides slide along freely", "share"),
    "contact-slip": Form((0.03, 0.25), "Coulomb's friction", "coefficient"),
    "support-compliance": Form(
        (0.15, 0.7),
        "a series spring that hardens; felupe: each bone on springs",
        "compliance, mm/N",
        False,
        {"hardening": (0.02, 0.15)},
    ),
    "preconditioning": Form(
        (0.05, 0.2),
        "an excess that falls with depth and fades from trial to trial",
        "excess of the first trial",
        False,
        {"fading": (0.1, 0.6), "grading": (-0.4, 0.4)},
    ),
    "muscle-contraction": Form(
        (0.04, 0.2),
        "a tension that rises, then gives way by a third",
        "rise of the force",
        False,
        {"onset": (0.2, 0.7), "rise": (0.03, 0.15)},
    ),
    "force-drift": Form(
        (0.15, 0.6), "a load cell that warms up: it levels off", "whole drift, N", False, {"time": (15.0, 80.0)}
    ),
    "end-effects": Form((0.8, 2.0), "another leg's correction", "scale"),
}
OUTSIDE: Mapping[str, str] = {
    "ripple": "a ripple over the drive's pitch",
    "lump": "a stiffer lump in the muscle, solved by felupe",
    "drop": "something comes loose at a depth",
    "clipping": "an amplifier that saturates",
    "leg-shift": "the leg moves away and comes back",
    "frame": "the frame meets the leg at a depth, and bears a part of the force from there",
}
NAMED: Mapping[str, str] = {"lump": "uneven-muscle", "leg-shift": "leg-movement"}
"""Of these, the mechanism that the library has for it, in another form."""


def drawn_values(
    name: str, code: str, law: str, c10: float, generator: np.random.Generator
) -> tuple[tuple[str, float], ...]:
    """Return an effect's numbers, its strength first."""
    form = FORMS[name]
    strength = float(np.exp(generator.uniform(*np.log(form.strengths))))
    if name == "strain-stiffening" and (law == "neo-hookean" or code == "felupe"):
        # Of the stiffness' own size, as in the first paper's subjects.
        strength = c10 * float(generator.uniform(0.2, 1.0))
    others = form.others.items()
    return (("strength", strength), *((key, float(generator.uniform(*ends))) for key, ends in others))


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
    factor: Callable[[FloatArray], FloatArray]
    """Of the cylinder's ends on the force, at displacements."""

    @property
    def depth(self) -> float:
        """Mm."""
        return float(self.displacement.max())


def _preconditioning(trial: Pressed, v: Mapping[str, float]) -> FloatArray:
    graded = 1.0 + v["grading"] * np.cos(np.pi * trial.displacement / trial.depth)
    return trial.force * (1.0 + v["strength"] * v["fading"] ** trial.trial * graded)


def _support(trial: Pressed, v: Mapping[str, float]) -> FloatArray:
    """Return the force where a hardening spring takes up part of the way."""
    pressed = np.linspace(0.0, trial.depth, 600)
    force = trial.elastic(pressed)
    way = pressed + v["strength"] * force / (1.0 + v["hardening"] * force)
    less = np.interp(trial.displacement, way, force)
    whole = np.maximum(trial.elastic(trial.displacement), 1e-9)
    return np.asarray(trial.force * np.where(trial.displacement > 0, less / whole, 1.0))


def _contraction(trial: Pressed, v: Mapping[str, float]) -> FloatArray:
    whole = trial.time[-1]
    since = (trial.time / whole - v["onset"]) / v["rise"]
    risen = 0.5 * (1 - np.cos(np.pi * np.clip(since, 0.0, 1.0)))
    tired = 1.0 - np.clip(since - 1.0, 0.0, None) / (3.0 + np.clip(since - 1.0, 0.0, None)) / 3
    return np.asarray(trial.force * (1.0 + v["strength"] * risen * tired))


def _drift(trial: Pressed, v: Mapping[str, float]) -> FloatArray:
    return np.asarray(trial.force + v["strength"] * (1.0 - np.exp(-trial.time / v["time"])))


def _ends(trial: Pressed, v: Mapping[str, float]) -> FloatArray:
    return np.asarray(trial.force * (1.0 - v["strength"] * trial.factor(trial.displacement)))


ON_COURSE: Mapping[str, Callable[[Pressed, Mapping[str, float]], FloatArray]] = {
    "support-compliance": _support,
    "end-effects": _ends,
    "preconditioning": _preconditioning,
    "muscle-contraction": _contraction,
    "force-drift": _drift,
}
"""In the order in which they act."""


def _ripple(trial: Pressed, size: float) -> FloatArray:
    moving = np.abs(np.gradient(trial.displacement, trial.time)) > 1e-6
    wave = np.sin(2 * np.pi * trial.displacement / 3.0)
    return np.asarray(trial.force + 0.03 * size * trial.force.max() * wave * moving)


def _drop(trial: Pressed, size: float) -> FloatArray:
    after = np.arange(len(trial.time)) >= np.argmax(trial.displacement > 11.0)
    return np.asarray(trial.force - 0.04 * size * trial.force.max() * after)


def _clipping(trial: Pressed, size: float) -> FloatArray:
    return np.minimum(trial.force, (1.0 - 0.08 * size) * trial.force.max())


def _leg_shift(trial: Pressed, size: float) -> FloatArray:
    loading = np.arange(len(trial.time)) <= np.argmax(trial.displacement)
    bump = np.exp(-(((trial.displacement - 13.0) / 1.2) ** 2)) * loading
    return np.asarray(trial.force - 0.05 * size * trial.force.max() * bump)


def _rig_bends(trial: Pressed, size: float) -> FloatArray:
    """Return the force where the rig gives way the more easily the harder it is pressed."""
    pressed = np.linspace(0.0, trial.depth, 600)
    force = trial.elastic(pressed)
    way = pressed + 0.12 * size * force * (1.0 + force / force.max())
    whole = np.maximum(trial.elastic(trial.displacement), 1e-9)
    less = np.interp(trial.displacement, way, force)
    return np.asarray(trial.force * np.where(trial.displacement > 0, less / whole, 1.0))


def _twitch(trial: Pressed, size: float) -> FloatArray:
    """Return the force of a muscle that tenses and lets go in the second trial."""
    since = (trial.time / trial.time[-1] - 0.45) / 0.08
    return np.asarray(trial.force * (1.0 + 0.15 * size * np.exp(-(since**2)) * (trial.trial == 1)))


def _frame(trial: Pressed, size: float) -> FloatArray:
    beyond = np.maximum(trial.displacement - 14.0, 0.0) / (trial.depth - 14.0)
    return np.asarray(trial.force - 0.08 * size * trial.force.max() * beyond)


OUTSIDE_ON_COURSE: Mapping[str, Callable[[Pressed, float], FloatArray]] = {
    "ripple": _ripple,
    "drop": _drop,
    "clipping": _clipping,
    "leg-shift": _leg_shift,
    "frame": _frame,
    "rig-bends": _rig_bends,
    "twitch": _twitch,
}

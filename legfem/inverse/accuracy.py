"""How well the numbers are known that a base model assumes of a body, and what was measured of it by other means."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from legfem.common.errors import InputError
from legfem.common.resources import resource
from legfem.inverse.mechanism import Mechanism, null_of, prior_of
from legfem.inverse.parameter import Prior

_ASSUMED = resource("parameters", dict[str, dict[str, Any]])["assumed"]
MATERIAL_LOG_SD: Mapping[str, float] = {name: one["log_sd"] for name, one in _ASSUMED.items()}
"""Of the logarithms of what is assumed."""
MATERIAL_DOF = 8.0
"""Degrees of freedom of how far what is assumed of tissues is off: known to 25 % (JCGM 100:2008, G.4.2)."""
GEOMETRY_DOF = 3.0
"""Degrees of freedom of the accuracy of a shape and a placement, stated or usual: known to some
40 %, as inter-observer distances of 0.3 to 0.8 mm are (JCGM 100:2008, G.4.2)."""
SIZE = "size."
"""What full names of sizes begin with."""
SIZE_LOG_SD = 0.01
"""Of the logarithm of a body's or an indenter's size, by calipers on what gives way."""
_A_SIZE = "stated size: "


def word_of(name: str) -> str:
    """Return what an assumed number is called."""
    size = name.removeprefix(SIZE)
    return str(_ASSUMED[name]["called"]) if size == name else f"{_A_SIZE}{size.replace('_', ' ')}"


@dataclass(frozen=True)
class MeasuredEffect:
    """How strong an effect is that a model may leave out, by other means than the indenter."""

    effect: str
    """Name of a mechanism."""
    value: float
    """In the unit of the mechanism's strength."""
    sd: float
    source: str


@dataclass(frozen=True)
class Cause:
    """Where the standard deviation of a nuisance parameter comes from, and its degrees of freedom.

    Effects of one cause are off by one factor together.
    """

    name: str
    degrees_of_freedom: float = math.inf


@dataclass(frozen=True)
class ShapeError:
    """A way in which a body's shape or placement may be other than stated."""

    name: str
    weights: Mapping[str, float]
    """One standard deviation of it, as a sum of errors of the geometry (`BodyModels.geometric`) by name."""
    cause: Cause


@dataclass(frozen=True)
class Accuracy:
    """How well a body is known.

    Parameters
    ----------
    assumed_sd
        Relative, of stiffnesses and compressibility that are assumed; the usual of each without it.
    size_sd
        Relative, of sizes.
    measured
        Stiffnesses (MPa) by other means, by full name: ``deep.C10``, ``superficial.C10``.
    effects
        How strong effects are that the model may leave out, by other means.
    contact_sd
        Of first contact (mm) in all trials alike, where it is stated to be at zero; None as the load cell feels it.
    tared
        Whether the load cell's zero was taken where trials begin, in contact or not.
    """

    assumed_sd: float | None = None
    size_sd: float = SIZE_LOG_SD
    measured: Mapping[str, Prior] = field(default_factory=dict)
    effects: tuple[MeasuredEffect, ...] = ()
    contact_sd: float | None = 0.0
    tared: bool = False

    @property
    def shape_errors(self) -> tuple[ShapeError, ...]:
        """How the shape may be off: not at all, where sizes say all of it."""
        return ()

    def log_sd(self, material: str) -> float:
        """Return the standard deviation of an assumed number's logarithm."""
        if material.startswith(SIZE):
            return self.size_sd
        if (known := self.measured.get(material)) is not None:
            return known.sd if known.scale == "log" else known.sd / known.centre
        return MATERIAL_LOG_SD[material] if self.assumed_sd is None else self.assumed_sd


@dataclass(frozen=True)
class MeasuredStrength:
    """A reading of a mechanism's strength, as a departure from its null.

    Parameters
    ----------
    mechanism
        Which.
    prior_z, sd
        In standard deviations of what is known of the strength beforehand.
    """

    mechanism: Mechanism
    prior_z: float
    sd: float

    @property
    def name(self) -> str:
        """Full name of the strength."""
        return self.mechanism.strength_name


def measured_strength(mechanism: Mechanism, value: float, sd: float, accuracy: Accuracy) -> MeasuredStrength:
    """Return a reading as a departure, and how well it tells what the recordings felt.

    Parameters
    ----------
    mechanism
        Which.
    value
        Of its strength, in its unit.
    sd
        In its unit, or of a factor's logarithm.
    accuracy
        Of what is assumed of the body: that may be off as well, without being named.
    """
    prior = prior_of(mechanism.parameters[0])
    whole = float(np.hypot(sd, max((accuracy.log_sd(name) for name in mechanism.scaled), default=0.0)))
    apart = prior.departure(value)
    # Over the way to what the effect is nothing at, so that readings of nothing count by their own errors.
    of_one = (value - prior.centre) / apart if prior.scale == "tailed" and apart else prior.sd
    return MeasuredStrength(mechanism, apart, whole / of_one)


def measured_strengths(accuracy: Accuracy, able: Sequence[Mechanism]) -> Iterator[MeasuredStrength]:
    """Yield the readings of those mechanisms that are weighed; of others they tell nothing."""
    weighed = {m.name: m for m in able}
    for one in accuracy.effects:
        if (mechanism := weighed.get(one.effect)) is not None:
            sd = one.sd / one.value if prior_of(mechanism.parameters[0]).scale == "log" else one.sd
            yield measured_strength(mechanism, one.value, sd, accuracy)


def check_measured(toml: Path, effects: Sequence[MeasuredEffect], mechanisms: Sequence[Mechanism]) -> None:
    """Check that measured strengths are of mechanisms that there are, and possible.

    Raises
    ------
    InputError
        If one isn't.
    """
    every = {m.name: m for m in mechanisms}
    for number, one in enumerate(effects):
        field = f"measured.{number}"
        if one.effect not in every:
            problem = f"{one.effect!r} is not an effect that legfem knows"
            raise InputError(toml, f"{field}.effect", problem, f"give one of {', '.join(every)}")
        first = every[one.effect].parameters[0]
        low, high = first.bounds
        if not low <= one.value <= high:
            remedy = f"give {first.statement}: {low:g} to {high:g}, {null_of(first):g} without the effect"
            raise InputError(toml, f"{field}.value", f"{one.value:g} is impossible ({first.unit})", remedy)

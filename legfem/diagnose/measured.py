"""Strengths of mechanisms that were measured by themselves: ``[[measured]]`` of a subject.

A dial gauge on the shin tells how far a support gives way, shear waves how stiff a fascia is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from legfem.common.errors import InputError
from legfem.diagnose.mechanisms import Mechanism, TissueMechanism, mechanisms
from legfem.diagnose.mechanisms.base import null_of, prior_of, value_at
from legfem.diagnose.nuisances import Accuracy
from legfem.legs.subject import MeasuredEffect


@dataclass(frozen=True)
class MeasuredStrength:
    """A reading of a mechanism's strength, as a departure from its null.

    Parameters
    ----------
    mechanism
        Which.
    departure, sd
        In standard deviations of what is known of the strength beforehand.
    """

    mechanism: Mechanism
    departure: float
    sd: float

    @property
    def name(self) -> str:
        """Full name of the strength."""
        return f"{self.mechanism.name}.{self.mechanism.parameters[0].name}"


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
        Of what is assumed of the leg: that may be off as well, without being named.
    """
    prior = prior_of(mechanism.parameters[0])
    whole = float(np.hypot(sd, _assumed_sd(mechanism, accuracy)))
    return MeasuredStrength(mechanism, prior.departure(value), whole / prior.sd)


def measured_strengths(accuracy: Accuracy, able: Sequence[Mechanism]) -> tuple[MeasuredStrength, ...]:
    """Return the readings of those mechanisms that are weighed; of others they tell nothing."""
    weighed = {m.name: m for m in able}
    pairs = [(weighed[one.effect], one) for one in accuracy.effects if one.effect in weighed]
    return tuple(measured_strength(mechanism, one.value, _sd_of(mechanism, one), accuracy) for mechanism, one in pairs)


def check_measured(toml: Path, effects: Sequence[MeasuredEffect]) -> None:
    """Check that strengths are of effects that legfem knows, and possible.

    Raises
    ------
    InputError
        If one isn't.
    """
    every = {m.name: m for m in mechanisms()}
    for number, one in enumerate(effects):
        field = f"measured.{number}"
        if one.effect not in every:
            raise InputError(
                toml,
                f"{field}.effect",
                f"{one.effect!r} is no effect that legfem knows",
                f"give one of {', '.join(every)}",
            )
        first = every[one.effect].parameters[0]
        low, high = first.bounds
        if not low <= one.value <= high:
            raise InputError(
                toml,
                f"{field}.value",
                f"{one.value:g} is impossible ({first.unit})",
                f"give {first.statement}: {low:g} to {high:g}, {null_of(first):g} without the effect",
            )


def _sd_of(mechanism: Mechanism, one: MeasuredEffect) -> float:
    return one.sd / one.value if prior_of(mechanism.parameters[0]).scale == "log" else one.sd


def _assumed_sd(mechanism: Mechanism, accuracy: Accuracy) -> float:
    """Return how far what a factor multiplies may be off without it (logarithm)."""
    first = mechanism.parameters[0]
    if not isinstance(mechanism, TissueMechanism) or prior_of(first).scale != "log":
        return 0.0
    scaled = mechanism.solution({first.name: value_at(first, 1.0)}).scaled
    return max((accuracy.log_sd(name) for name in scaled), default=0.0)

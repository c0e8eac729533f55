"""Strengths of mechanisms that were measured by themselves, without the indenter."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from legfem.common.errors import InputError
from legfem.inverse.accuracy import Accuracy, MeasuredEffect
from legfem.inverse.mechanism import Mechanism, null_of, prior_of


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
    return MeasuredStrength(mechanism, prior.departure(value), whole / prior.sd)


def measured_strengths(accuracy: Accuracy, able: Sequence[Mechanism]) -> tuple[MeasuredStrength, ...]:
    """Return the readings of those mechanisms that are weighed; of others they tell nothing."""
    weighed = {m.name: m for m in able}
    found = []
    for one in accuracy.effects:
        if (mechanism := weighed.get(one.effect)) is not None:
            sd = one.sd / one.value if prior_of(mechanism.parameters[0]).scale == "log" else one.sd
            found.append(measured_strength(mechanism, one.value, sd, accuracy))
    return tuple(found)


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
            raise InputError(
                toml,
                f"{field}.effect",
                f"{one.effect!r} is not an effect that legfem knows",
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

"""Strengths of mechanisms that were measured by themselves: ``[[measured]]`` of a subject.

A dial gauge on the shin tells how far a support gives way, shear waves how stiff a fascia is.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from legfem.common.errors import InputError
from legfem.diagnose.mechanisms import Mechanism, mechanisms
from legfem.diagnose.mechanisms.base import MeasuredStrength, measured_strength, null_of, prior_of
from legfem.diagnose.nuisances import Accuracy
from legfem.legs.subject import MeasuredEffect


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

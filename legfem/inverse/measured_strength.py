"""Strengths of mechanisms that were measured by themselves, without the indenter."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from legfem.inverse.mechanism import Mechanism, prior_of


class AssumedAccuracy(Protocol):
    """How well the numbers are known that a base model assumes."""

    def log_sd(self, name: str) -> float:
        """Return the standard deviation of an assumed number's logarithm."""
        ...


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
        return f"{self.mechanism.name}.{self.mechanism.parameters[0].name}"


def measured_strength(mechanism: Mechanism, value: float, sd: float, accuracy: AssumedAccuracy) -> MeasuredStrength:
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

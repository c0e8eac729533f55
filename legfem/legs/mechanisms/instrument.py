"""The load cell's zero drifts, or displacement isn't counted from first contact."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.mechanism import Mechanism, Values, strength
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter


@dataclass(frozen=True)
class ForceDrift(Mechanism):
    """The load cell's zero moves with time, from the start of each trial."""

    name: ClassVar[str] = "force-drift"
    statement: ClassVar[str] = "the load cell's zero drifted in time"
    parameters: ClassVar[tuple[Parameter, ...]] = (strength("rate", "N/s", "drift of the zero", 0.005, (-0.1, 0.1)),)
    would_be: ClassVar[str] = "a zero that drifts by {}"
    next_experiment: ClassVar[str] = "record a minute in air before and after each trial, and compare the zeros"
    measured_sd: ClassVar[float | None] = 0.0005
    """An estimate: 0.05 N over 100 s."""

    def added_force(self, values: Values, observed: Observations) -> FloatArray:
        """Return the drift."""
        return values["rate"] * observed.time


@dataclass(frozen=True)
class ContactOnset(Mechanism):
    """Displacement doesn't count from first touch, though it is stated to."""

    name: ClassVar[str] = "contact-onset"
    statement: ClassVar[str] = (
        "the displacement was not counted from first contact: the leg was touched later or earlier"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("offset", "mm", "displacement at first contact", 1.0, (-3.0, 5.0)),
    )
    next_experiment: ClassVar[str] = (
        "start the recording in air, 2 mm before the skin, so that first contact can be seen"
    )

    def untestable(self, observed: Observations) -> str | None:
        """Return whether first contact is stated."""
        if observed.starts_at_contact:
            return None
        return "first contact isn't stated to be at zero, so that every fit finds it"

    def displacement_loss(self, values: Values, observed: Observations, force: FloatArray) -> FloatArray:
        """Return the offset."""
        return np.full(len(force), values["offset"])

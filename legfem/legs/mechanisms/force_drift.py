"""The load cell's zero drifts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

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

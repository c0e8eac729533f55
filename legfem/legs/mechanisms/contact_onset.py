"""Displacement doesn't count from first touch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.mechanism import Mechanism, Values, strength
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter


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

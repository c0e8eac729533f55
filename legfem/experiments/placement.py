"""Where the indenter really stood."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from legfem.common.errors import InputError
from legfem.common.units import FloatArray


@dataclass(frozen=True)
class Placement:
    """The line of travel, moved from the one stated; at zero it is the one stated.

    Parameters
    ----------
    tilt_deg : float
        Angle that the travel is turned by, about the point of first touch, counter-clockwise
        (degrees). The load cell turns with it.
    offset_mm : float
        Shift of the line, before it is turned, to the left of the travel stated (mm); zero
        displacement stays at first touch.

    Raises
    ------
    InputError
        For numbers that aren't finite, or a travel turned by 60 degrees or more.
    """

    tilt_deg: float = 0.0
    offset_mm: float = 0.0

    def __post_init__(self) -> None:
        """Check both numbers."""
        for field in ("tilt_deg", "offset_mm"):
            if not math.isfinite(getattr(self, field)):
                raise InputError("placement", field, "is not finite", "give a finite number")
        if abs(self.tilt_deg) >= 60:
            raise InputError("placement", "tilt_deg", f"is {self.tilt_deg:g}", "give less than 60 degrees")

    def aim(self, aim: FloatArray, direction: FloatArray) -> FloatArray:
        """Return a point on the shifted line, from one on the line stated (mm)."""
        return aim + self.offset_mm * np.array([-direction[1], direction[0]])

    def travel(self, direction: FloatArray) -> FloatArray:
        """Return the turned unit vector of travel."""
        angle = math.radians(self.tilt_deg)
        x, y = direction
        return np.array([math.cos(angle) * x - math.sin(angle) * y, math.sin(angle) * x + math.cos(angle) * y])

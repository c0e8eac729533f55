"""The cylinder travels in another direction than stated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from legfem.inverse.mechanism import Solution, TissueMechanism, Values, strength
from legfem.inverse.parameter import Parameter


@dataclass(frozen=True)
class IndenterTilt(TissueMechanism):
    """The line of travel, turned about the point of first touch."""

    name: ClassVar[str] = "indenter-tilt"
    statement: ClassVar[str] = "the cylinder did not travel in the direction stated"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("angle", "degrees", "of the travel from the one stated", 8.0, (-20.0, 20.0)),
    )
    would_be: ClassVar[str] = "a travel turned by {} from the one stated"
    next_experiment: ClassVar[str] = "photograph the cylinder against the leg at both ends of the travel"
    measured_sd: ClassVar[float | None] = 1.5
    """An estimate."""
    strengths: ClassVar[tuple[float, ...]] = (-8.0, 8.0)

    def solution(self, values: Values) -> Solution:
        """Return the model pressed along the turned line."""
        return Solution(tilt_deg=values["angle"])

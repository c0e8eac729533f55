"""The fat isn't as stiff as assumed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from legfem.inverse.mechanism import Solution, TissueMechanism, Values, factor
from legfem.inverse.parameter import Parameter


@dataclass(frozen=True)
class SuperficialStiffness(TissueMechanism):
    """The fat's stiffness, over the one given."""

    name: ClassVar[str] = "superficial-stiffness"
    statement: ClassVar[str] = "the superficial tissue (fat) is stiffer or softer than assumed"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        factor("factor", "on C10", (0.1, 9.0), 0.9, "reported stiffness of fat differs tenfold"),
    )
    would_be: ClassVar[str] = "fat of {} times the assumed stiffness"
    next_experiment: ClassVar[str] = (
        "press gently with a small tip (2 mm deep), or image the fat's thickness under load"
    )
    measured_sd: ClassVar[float | None] = 0.25
    """An estimate."""
    strengths: ClassVar[tuple[float, ...]] = (0.4, 1.7, 3.5, 8.0)

    def solution(self, values: Values) -> Solution:
        """Return the model with that parameter scaled."""
        return Solution(scaled={"superficial.C10": values["factor"]})

"""The fascia isn't as stiff as assumed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from legfem.inverse.mechanism import Solution, TissueMechanism, Values, factor
from legfem.inverse.parameter import Parameter


@dataclass(frozen=True)
class FasciaStiffness(TissueMechanism):
    """The fascia's stiffness times thickness, over the one given."""

    name: ClassVar[str] = "fascia-stiffness"
    statement: ClassVar[str] = "the fascia is stiffer, softer, thicker or thinner than assumed"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        factor(
            "factor", "on stiffness times thickness", (0.05, 50.0), 1.4, "crural fascia is reported from 0.1 to 100 MPa"
        ),
    )
    would_be: ClassVar[str] = "a fascia of {} times the assumed stiffness"
    next_experiment: ClassVar[str] = "measure the fascia by shear-wave elastography"
    measured_sd: ClassVar[float | None] = 0.4
    """An estimate: a sheet thinner than a wave is long."""
    strengths: ClassVar[tuple[float, ...]] = (0.2, 3.0, 9.0, 26.0)

    def solution(self, values: Values) -> Solution:
        """Return the model with that parameter scaled."""
        return Solution(scaled={"fascia.C10": values["factor"]})

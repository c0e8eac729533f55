"""The deep tissue's compressibility isn't the one given."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from legfem.inverse.mechanism import Solution, TissueMechanism, Values, factor
from legfem.inverse.parameter import Parameter


@dataclass(frozen=True)
class Compressibility(TissueMechanism):
    """The deep tissue's D1, over the one given."""

    name: ClassVar[str] = "compressibility"
    statement: ClassVar[str] = "the deep tissue loses or keeps more volume than the compressibility given says"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        factor("factor", "on D1", (0.1, 60.0), 1.3, "reported bulk moduli of muscle differ a hundredfold"),
    )
    would_be: ClassVar[str] = "a muscle of {} times the assumed compressibility"
    next_experiment: ClassVar[str] = "image the section under load and measure how its area changes"
    measured_sd: ClassVar[float | None] = 0.7
    """An estimate: areas to 0.5 % beside changes of 1 %."""
    strengths: ClassVar[tuple[float, ...]] = (0.3, 3.0, 9.0, 26.0)

    def solution(self, values: Values) -> Solution:
        """Return the model with that parameter scaled."""
        return Solution(scaled={"deep.D1": values["factor"]})

"""The fascia is under tension in the imaged state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from legfem.common.units import kpa_to_mpa
from legfem.inverse.mechanism import IndentedLeg, Solution, TissueMechanism, Values, strength
from legfem.inverse.parameter import Parameter


@dataclass(frozen=True)
class FasciaPrestress(TissueMechanism):
    """Tension of the fascia in the imaged state."""

    name: ClassVar[str] = "prestress"
    statement: ClassVar[str] = "the fascia was under tension before the test"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("tension", "kPa", "tension of the fascia at rest", 100.0, (0.0, 500.0)),
    )
    would_be: ClassVar[str] = "a fascia under a tension of {}"
    next_experiment: ClassVar[str] = (
        "measure the pressure in the compartment at rest, or shear-wave speeds along the fascia"
    )
    measured_sd: ClassVar[float | None] = 40.0
    """An estimate: 1 kPa of pressure times the fascia's radius over its thickness."""
    strengths: ClassVar[tuple[float, ...]] = (20.0, 100.0, 300.0)

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the fascia's tension."""
        from legfem.mechanics.terms import Prestress

        return [Prestress(leg.section.fascia)]

    def solution(self, values: Values) -> Solution:
        """Return the model with the tension."""
        return Solution(parameters={"fascia.prestress.tension": kpa_to_mpa(values["tension"])})

"""The fat stiffens with strain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from legfem.common.units import kpa_to_mpa
from legfem.inverse.mechanism import IndentedLeg, Solution, TissueMechanism, Values, strength
from legfem.inverse.parameter import Parameter


@dataclass(frozen=True)
class FatStiffening(TissueMechanism):
    """A second and a third coefficient of the fat's energy, where the model has one."""

    name: ClassVar[str] = "superficial-stiffening"
    statement: ClassVar[str] = "the superficial tissue (fat) stiffens as it is squeezed"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("coefficient", "kPa", "of the fat's energy's third power", 3.0, (0.0, 60.0)),
    )
    next_experiment: ClassVar[str] = "image the fat's thickness under load, at several depths"
    strengths: ClassVar[tuple[float, ...]] = (1.0, 6.0, 25.0)

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the fat with more coefficients of its energy."""
        from legfem.mechanics.materials import Yeoh
        from legfem.mechanics.terms import Tissue

        return [Tissue("superficial", Yeoh.of(leg.tissues.superficial))]

    def solution(self, values: Values) -> Solution:
        """Return the law with its third coefficient."""
        return Solution(parameters={"superficial.C30": kpa_to_mpa(values["coefficient"])})

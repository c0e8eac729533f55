"""The deep tissue stiffens more than its law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from legfem.common.units import kpa_to_mpa
from legfem.inverse.mechanism import IndentedLeg, Solution, TissueMechanism, Values, strength
from legfem.inverse.parameter import Parameter

if TYPE_CHECKING:
    from legfem.mechanics.materials import Hyperelastic


@dataclass(frozen=True)
class StrainStiffening(TissueMechanism):
    """One more term of the energy's series in (I1 - 3)."""

    name: ClassVar[str] = "strain-stiffening"
    statement: ClassVar[str] = "the deep tissue stiffens with strain more than the law used can describe"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("coefficient", "kPa", "of the energy's next power of strain", 1.5, (0.0, 20.0)),
    )
    next_experiment: ClassVar[str] = "press deeper, or with a smaller indenter: larger strains"
    strengths: ClassVar[tuple[float, ...]] = (0.3, 1.2, 4.0)
    stands_for_C20: ClassVar[bool] = True

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the tissue with a third coefficient of its energy."""
        return self.terms_of(leg.tissues.deep)

    def terms_of(self, law: Hyperelastic) -> Sequence[Any]:
        """Return the same of a body of one tissue."""
        from legfem.mechanics.materials import Yeoh
        from legfem.mechanics.terms import Tissue

        return [Tissue("deep", Yeoh.of(law))]

    def solution(self, values: Values) -> Solution:
        """Return the law with its third coefficient."""
        return Solution(parameters={"deep.C30": kpa_to_mpa(values["coefficient"])})

"""Fluid drains from the deep tissue."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from legfem.inverse.mechanism import IndentedLeg, Solution, TissueMechanism, Values, strength
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter
from legfem.legs.mechanisms.viscoelasticity import needs_time

if TYPE_CHECKING:
    from legfem.mechanics.model import Formulation


@dataclass(frozen=True)
class PoroelasticDrainage(TissueMechanism):
    """Darcy flow of fluid through the deep tissue."""

    name: ClassVar[str] = "poroelastic-drainage"
    statement: ClassVar[str] = "fluid is squeezed through the tissue and its volume follows in time"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("permeability", "mm4/(N s)", "Darcy's, of the deep tissue", 30.0, (0.0, 500.0)),
    )
    next_experiment: ClassVar[str] = (
        "hold for several minutes with indenters of two sizes: drainage takes time with the size "
        "squared, relaxation does not"
    )
    variant: ClassVar[str] = "porous"
    formulation: ClassVar[Formulation | None] = "porous"
    along_path: ClassVar[bool] = True
    strengths: ClassVar[tuple[float, ...]] = (10.0, 80.0)

    def untestable(self, observed: Observations) -> str | None:
        """Return whether there are a hold, an unloading or two rates."""
        return needs_time(observed)

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the flow."""
        from legfem.mechanics.terms import Drainage

        return [Drainage("deep", leg.tissues.deep)]

    def solution(self, values: Values) -> Solution:
        """Return the porous model."""
        return Solution(self.variant, {"deep.drainage.permeability": values["permeability"]})

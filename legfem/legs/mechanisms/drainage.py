"""Fluid drains from the deep tissue."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from legfem.inverse.mechanism import IndentedLeg, Solution, TissueMechanism, Values, strength
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter, Prior
from legfem.legs.mechanisms.viscoelasticity import RELAXES, needs_time

if TYPE_CHECKING:
    from legfem.mechanics.model import Formulation

_USUAL = 0.03
"""Share of the stiffness in volume: a drained Poisson's ratio of 0.1."""
_BULK_OVER_SHEAR = 30.0
"""Of undrained muscle, about: what shares of a drop are found with."""


@dataclass(frozen=True)
class PoroelasticDrainage(TissueMechanism):
    r"""Darcy flow of fluid through the deep tissue, whose skeleton keeps a share of its stiffness in volume.

    What a softer or stiffer skeleton does is tabulated as a share of what the usual one does: of the drop from the
    undrained force of a half-space to the drained one, :math:`(1/2 - \nu) / (1 - \nu)` with the skeleton's Poisson's
    ratio :math:`\nu` (F ~ shear modulus over :math:`1 - \nu`).
    """

    name: ClassVar[str] = "poroelastic-drainage"
    statement: ClassVar[str] = "fluid is squeezed through the tissue and its volume follows in time"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("permeability", "mm4/(N s)", "Darcy's, of the deep tissue", 400.0, (0.0, 3000.0)),
        Parameter(
            "skeleton",
            "-",
            (0.003, 0.5),
            Prior(_USUAL, 1.0, "log", "drained Poisson's ratios of 0 to 0.4 of soft tissue"),
            scale="log",
            statement="share of the stiffness in volume that stays when all fluid has gone",
        ),
    )
    kin: ClassVar[str] = RELAXES
    next_experiment: ClassVar[str] = (
        "hold for several minutes with indenters of two sizes: drainage takes time with the size "
        "squared, relaxation does not"
    )
    variant: ClassVar[str] = "porous"
    formulation: "ClassVar[Formulation | None]" = "porous"
    along_path: ClassVar[bool] = True
    strengths: ClassVar[tuple[float, ...]] = (10.0, 80.0, 400.0, 1600.0)

    def untestable(self, observed: Observations) -> str | None:
        """Return whether there are a hold, an unloading or two rates."""
        return needs_time(observed)

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the flow."""
        from legfem.mechanics.terms import Drainage

        return [Drainage("deep", leg.tissues.deep)]

    def solution(self, values: Values) -> Solution:
        """Return the porous model."""
        numbers = {f"deep.drainage.{name}": values[name] for name in ("permeability", "skeleton")}
        return Solution(self.variant, numbers)

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return slow and fast drainage of the usual skeleton."""
        return tuple({"permeability": size, "skeleton": _USUAL} for size in (20.0, 120.0, 700.0))

    def share(self, values: Values) -> float:
        """Return how much of the usual skeleton's drop there is."""
        return _drop(values["skeleton"]) / _drop(_USUAL)


def _drop(skeleton: float) -> float:
    """Return the share of a half-space's force that drainage takes."""
    bulk = _BULK_OVER_SHEAR * skeleton
    poisson = (3 * bulk - 2) / (6 * bulk + 2)
    return (0.5 - poisson) / (1 - poisson)

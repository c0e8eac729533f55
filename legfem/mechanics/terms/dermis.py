"""The dermis, as a thin sheet on the skin."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import ufl

from legfem.common.errors import check_positive
from legfem.mechanics.integration_domain import Skin
from legfem.mechanics.kinematics import Expr
from legfem.mechanics.model import Memoryless


@dataclass(frozen=True)
class Dermis(Memoryless):
    r"""An incompressible neo-Hookean membrane on the skin, which both papers leave out.

    .. math:: W = \frac{k}{2} \left(\operatorname{tr} C_s + \frac{1}{\det C_s} - 3\right)

    a reference area, with the right Cauchy-Green tensor :math:`C_s` of the skin in itself and
    :math:`k = 2 C_{10} h`, shear modulus times thickness. Stretched by :math:`\lambda` in plane
    strain it bears the tension :math:`k (\lambda - \lambda^{-3})` a unit length; it doesn't resist
    bending, and being attached it bears compression too, without wrinkles. Nothing happens at
    ``stiffness = 0``.

    R. W. Ogden, Non-linear Elastic Deformations (1984), section 7.3. At 1.5 mm of dermis whose C10
    is 10 kPa, k is 0.03 N/mm.

    Parameters
    ----------
    stiffness : float
        :math:`k` (N/mm).
    """

    stiffness: float = 0.0
    name: str = "dermis"
    domain: Literal["skin"] = "skin"

    def __post_init__(self) -> None:
        """Check the stiffness."""
        check_positive(self, "stiffness", zero_allowed=True)

    @property
    def parameters(self) -> dict[str, float]:
        """The stiffness (N/mm)."""
        return {f"{self.name}.stiffness": self.stiffness}

    def energy_density(self, skin: Skin) -> Expr:
        """Return the energy a reference area (N/mm)."""
        stiffness = skin.symbols.scalar(f"{self.name}.stiffness", self.stiffness)
        trace, determinant = skin.sheet_invariants
        return 0.5 * stiffness * (trace + 1 / determinant - 3)

    def residual(self, skin: Skin, history: Mapping[str, Any]) -> Expr:
        """Return the variation of the energy."""
        energy = self.energy_density(skin) * skin.measure
        return ufl.derivative(energy, skin.unknown, skin.test)

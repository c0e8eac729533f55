"""A given pressure on the skin, as a stocking's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import ufl

from legfem.mechanics.integration_domain import Skin
from legfem.mechanics.kinematics import Expr
from legfem.mechanics.model import Memoryless


@dataclass(frozen=True)
class SkinPressure(Memoryless):
    r"""The system's applied pressure :math:`p`, in full at 1 s and in proportion before.

    A follower load acts along the deformed normal on the deformed area,

    .. math:: \delta W = \int t\, p\, n \cdot \delta u\, da,
              \qquad n\, da = \mathrm{cof}(F)\, N\, dA,

    a dead load along the reference normal on the reference area, :math:`N\, dA`.

    Parameters
    ----------
    follower : float
        1 for a load that follows the surface, 0 for a dead one; in between, a mixture.
    """

    follower: float = 1.0
    name: str = "skin_pressure"
    domain: Literal["skin"] = "skin"

    @property
    def parameters(self) -> dict[str, float]:
        """Whether it follows; the pressure itself is a field of the system."""
        return {f"{self.name}.follower": self.follower}

    def residual(self, skin: Skin, history: Mapping[str, Any]) -> Expr:
        """Return the virtual work against the pressure."""
        share = skin.symbols.scalar(f"{self.name}.follower", self.follower)
        dead, live = (skin.area_vector(deformed) for deformed in (False, True))
        pushed = ufl.dot(dead + share * (live - dead), skin.variation)
        return skin.time * skin.applied_pressure * pushed * skin.measure

    def pressure(self, skin: Skin, growth: Expr) -> Expr:
        """Return the pressure per deformed area (MPa), by the growth of the area."""
        share = skin.symbols.scalar(f"{self.name}.follower", self.follower)
        return skin.time * skin.applied_pressure * (share + (1 - share) / growth)

"""The tissues' elasticity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from legfem.mechanics.integration_domain import Body
from legfem.mechanics.kinematics import Expr, volume_ratio
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.terms.energy_term import EnergyTerm


@dataclass(frozen=True)
class Tissue(EnergyTerm):
    """A hyperelastic region of the body."""

    region: str
    law: Hyperelastic
    domain: Literal["body"] = "body"

    @property
    def name(self) -> str:
        """The region's name."""
        return self.region

    @property
    def parameters(self) -> dict[str, float]:
        """The law's parameters."""
        return {f"{self.region}.{key}": value for key, value in self.law.parameters.items()}

    def energy_density(self, body: Body, F: Expr) -> Expr:
        r"""Return the strain energy (MPa) at a deformation gradient.

        In a mixed form the quadratic part is that by Legendre:

        .. math:: (J - 1)^2 / D_1 \to p (J - 1) - D_1 p^2 / 4
        """
        law = body.symbols.of(self.region, self.law)
        pressure = body.pressures.get(self.region)
        if pressure is None:
            return law.strain_energy(F)
        J = volume_ratio(F)
        dual = pressure * (J - 1) - law.D1 * pressure**2 / 4
        return law.distortion_energy(F) + dual + law.volumetric_remainder(J)

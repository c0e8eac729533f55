"""The tissues' elasticity."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import ufl

from legfem.kinematics import Expr, volume_ratio
from legfem.materials import Hyperelastic
from legfem.places import Body, Place


@dataclass(frozen=True)
class Tissue:
    """A hyperelastic region of the body."""

    region: str
    law: Hyperelastic
    place: Literal["body"] = "body"

    @property
    def name(self) -> str:
        """The region's name."""
        return self.region

    @property
    def parameters(self) -> dict[str, float]:
        """The law's parameters."""
        return {f"{self.region}.{key}": value for key, value in self.law.parameters.items()}

    def energy_density(self, body: Body) -> Expr:
        r"""Return the strain energy (MPa), in a mixed form with the quadratic part by Legendre.

        .. math:: (J - 1)^2 / D_1 \to p (J - 1) - D_1 p^2 / 4
        """
        law = body.symbols.of(self.region, self.law)
        F = body.deformation_gradient
        pressure = body.pressures.get(self.region)
        if pressure is None:
            return law.strain_energy(F)
        J = volume_ratio(F)
        dual = pressure * (J - 1) - law.D1 * pressure**2 / 4
        return law.distortion_energy(F) + dual + law.volumetric_remainder(J)

    def history(self, place: Place) -> dict[str, tuple[int, ...]]:
        """Return nothing: an elastic tissue has no memory."""
        return {}

    def residual(self, body: Body, history: Mapping[str, Any]) -> Expr:
        """Return the variation of the strain energy."""
        energy = self.energy_density(body) * body.regions[self.region]
        return ufl.derivative(energy, body.unknown, body.test)

    def updated(self, body: Body, history: Mapping[str, Any]) -> dict[str, Expr]:
        """Return nothing."""
        return {}

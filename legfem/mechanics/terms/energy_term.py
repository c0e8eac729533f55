"""A term that is an energy of a region."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import partial
from typing import Any

import ufl

from legfem.mechanics.integration_domain import Body
from legfem.mechanics.kinematics import Expr, nominal_stress
from legfem.mechanics.model import Memoryless


class EnergyTerm(Memoryless, ABC):
    """What an elastic energy adds: its variation, and the stress that follows from it."""

    region: str

    @abstractmethod
    def energy_density(self, body: Body, F: Expr) -> Expr:
        """Return the energy a reference volume (MPa) at a deformation gradient."""

    def residual(self, body: Body, history: Mapping[str, Any]) -> Expr:
        """Return the variation of the energy."""
        energy = self.energy_density(body, body.deformation_gradient)
        return ufl.derivative(energy * body.regions[self.region], body.unknown, body.test)

    def nominal_stress(self, body: Body) -> Expr:
        """Return the first Piola-Kirchhoff stress (MPa)."""
        return nominal_stress(partial(self.energy_density, body), body.deformation_gradient)

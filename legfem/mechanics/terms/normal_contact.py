"""Pressure between the indenter and the skin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import ufl

from legfem.mechanics.contact import PressureLaw, RigidIndenter
from legfem.mechanics.integration_domain import Skin
from legfem.mechanics.kinematics import Expr
from legfem.mechanics.model import Memoryless
from legfem.mechanics.parameters import named


@dataclass(frozen=True)
class NormalContact(Memoryless):
    """Pressure of the rigid indenter on the skin."""

    indenter: RigidIndenter
    law: PressureLaw
    name: str = "contact"
    domain: Literal["skin"] = "skin"

    @property
    def parameters(self) -> dict[str, float]:
        """Numbers of the indenter and of the law."""
        return {**named("indenter", self.indenter), **named(self.name, self.law)}

    def pressure(self, skin: Skin) -> Expr:
        """Return the pressure (MPa)."""
        indenter = skin.symbols.of("indenter", self.indenter)
        law = skin.symbols.of(self.name, self.law)
        return law.pressure(-indenter.gap(skin.relative_position))

    def residual(self, skin: Skin, history: Mapping[str, Any]) -> Expr:
        """Return the work of the pressure along the indenter's normal."""
        indenter = skin.symbols.of("indenter", self.indenter)
        normal = indenter.normal(skin.relative_position)
        return -self.pressure(skin) * ufl.dot(normal, skin.variation) * skin.measure

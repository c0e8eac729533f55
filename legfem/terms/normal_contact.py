"""Pressure between the indenter and the skin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import ufl

from legfem.contact import PressureLaw, RigidIndenter
from legfem.kinematics import Expr
from legfem.places import Place, Skin
from legfem.symbols import named


@dataclass(frozen=True)
class NormalContact:
    """Pressure of the rigid indenter on the skin."""

    indenter: RigidIndenter
    law: PressureLaw
    name: str = "contact"
    place: Literal["skin"] = "skin"

    @property
    def parameters(self) -> dict[str, float]:
        """Numbers of the indenter and of the law."""
        return {
            **named("indenter", self.indenter),
            **named(self.name, self.law),
        }

    def history(self, place: Place) -> dict[str, tuple[int, ...]]:
        """Return nothing."""
        return {}

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

    def updated(self, skin: Skin, history: Mapping[str, Any]) -> dict[str, Expr]:
        """Return nothing."""
        return {}

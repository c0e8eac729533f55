"""A tissue whose stiffness changes along the leg."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import ufl

from legfem.checks import check_positive
from legfem.kinematics import Expr
from legfem.materials import Hyperelastic
from legfem.places import Body


@dataclass(frozen=True)
class StiffnessGradient:
    r"""What of the distortion energy is more above a level, and less below it.

    .. math:: g\, \frac{z - z_0}{\ell}\, U_\text{distortion}

    is added to the region's energy; nothing happens at ``gradient = 0``. At the ankle tendons make
    the deep tissue stiffer than at the calf.

    Parameters
    ----------
    region : str
        Of the body; parameters are named ``<region>.stiffness_gradient.gradient`` and so on.
    law : Hyperelastic
        The region's, whose symbols are shared.
    level : float
        :math:`z_0` (mm).
    gradient : float
        :math:`g`, relative change over the length.
    length : float
        :math:`\ell` (mm).
    """

    region: str
    law: Hyperelastic
    level: float
    gradient: float = 0.0
    length: float = 100.0
    place: Literal["body"] = "body"

    def __post_init__(self) -> None:
        """Check the length."""
        check_positive(self, "length")

    @property
    def name(self) -> str:
        """For example ``deep.stiffness_gradient``."""
        return f"{self.region}.stiffness_gradient"

    @property
    def parameters(self) -> dict[str, float]:
        """Gradient, level and length."""
        return {f"{self.name}.{key}": getattr(self, key) for key in ("gradient", "level", "length")}

    def history(self, body: Body) -> dict[str, tuple[int, ...]]:
        """Return nothing."""
        return {}

    def residual(self, body: Body, history: Mapping[str, Any]) -> Expr:
        """Return the variation of what is added to the energy."""
        law = body.symbols.of(self.region, self.law)
        gradient, level, length = (
            body.symbols.scalar(name, value) for name, value in self.parameters.items()
        )
        domain = ufl.domain.extract_unique_domain(body.displacement)
        z = ufl.SpatialCoordinate(domain)[domain.geometric_dimension() - 1]
        added = gradient * (z - level) / length * law.distortion_energy(body.deformation_gradient)
        return ufl.derivative(added * body.regions[self.region], body.unknown, body.test)

    def updated(self, body: Body, history: Mapping[str, Any]) -> dict[str, Expr]:
        """Return nothing."""
        return {}

"""Muscle contraction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import ufl

from legfem.common.errors import check_positive
from legfem.mechanics.integration_domain import Body
from legfem.mechanics.kinematics import Expr, isochoric_first_invariant
from legfem.mechanics.terms.energy_term import EnergyTerm


@dataclass(frozen=True)
class Contraction(EnergyTerm):
    r"""The muscle tenses from a moment on, and resists more.

    Fibres along the leg do no work in plane strain, so a contraction shows as a raised transverse
    stiffness. The energy

    .. math:: s(t)\, C\, (\bar I_1 - 3), \quad s = 3 x^2 - 2 x^3, \quad
              x = \min(\max((t - t_0) / r, 0), 1)

    is added to the region's, with a switch :math:`s` whose rate is continuous. The relaxed leg
    keeps its shape when it tenses. Nothing happens at ``stiffness = 0``, or before the onset.

    Parameters
    ----------
    region : str
        Of the body; parameters are named ``<region>.contraction.stiffness`` and so on.
    stiffness : float
        :math:`C` (MPa), what C10 rises by.
    onset : float
        :math:`t_0` (s), of the protocol's clock.
    rise : float
        :math:`r` (s), from the onset to the full contraction.
    """

    region: str
    stiffness: float = 0.0
    onset: float = 0.0
    rise: float = 1.0
    domain: Literal["body"] = "body"

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_positive(self, "stiffness", zero_allowed=True)
        check_positive(self, "rise")

    @property
    def name(self) -> str:
        """For example ``deep.contraction``."""
        return f"{self.region}.contraction"

    @property
    def parameters(self) -> dict[str, float]:
        """Stiffness (MPa), onset (s) and rise (s)."""
        fields = ("stiffness", "onset", "rise")
        return {f"{self.name}.{field}": getattr(self, field) for field in fields}

    def energy_density(self, body: Body, F: Expr) -> Expr:
        """Return the added energy (MPa) at a deformation gradient."""
        stiffness, onset, rise = (body.symbols.scalar(name, value) for name, value in self.parameters.items())
        x = ufl.max_value(0, ufl.min_value(1, (body.time - onset) / rise))
        return stiffness * x**2 * (3 - 2 * x) * (isochoric_first_invariant(F) - 3)

"""Laws of the traction along the indenter's surface.

All laws are per unit of the skin's reference area and take or give UFL expressions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import ufl

from legfem.common.errors import check_positive
from legfem.mechanics.kinematics import Expr

Scalar = Any


class TangentialLaw(Protocol):
    """Traction along the indenter's surface as a function of elastic slip."""

    def traction(self, slip: Expr, pressure: Expr) -> Expr:
        """Return the traction (MPa) for the slip (mm) from the anchor."""


@dataclass(frozen=True)
class Frictionless:
    """No traction along the surface."""

    def traction(self, slip: Expr, pressure: Expr) -> Expr:
        """Return zero."""
        return 0 * slip


@dataclass(frozen=True)
class Rough:
    """No sliding: a point that touches stays where it touched, held by a stiff spring.

    Parameters
    ----------
    stiffness : float
        Of the spring (MPa/mm).
    """

    stiffness: Scalar

    def __post_init__(self) -> None:
        """Check the stiffness."""
        check_positive(self, "stiffness")

    def traction(self, slip: Expr, pressure: Expr) -> Expr:
        """Return ``stiffness * slip``."""
        return self.stiffness * slip


@dataclass(frozen=True)
class Coulomb:
    r"""Coulomb friction: stick up to :math:`\mu p`, then slip (radial return of the anchor).

    Parameters
    ----------
    friction : float
        Coefficient :math:`\mu`.
    stiffness : float
        Of the stick (MPa/mm).
    """

    friction: Scalar
    stiffness: Scalar

    def __post_init__(self) -> None:
        """Check both numbers."""
        check_positive(self, "friction", "stiffness")

    def traction(self, slip: Expr, pressure: Expr) -> Expr:
        """Return the traction, limited by ``friction * pressure``."""
        trial = self.stiffness * ufl.sqrt(ufl.dot(slip, slip) + 1e-24)
        limit = self.friction * pressure
        return self.stiffness * slip * ufl.conditional(ufl.lt(trial, limit), 1, limit / trial)


@dataclass(frozen=True)
class Tape:
    r"""Tape that fails: the skin sticks up to a shear strength, then slips at that traction.

    With the trial traction :math:`k s` of the slip :math:`s` and the weakness :math:`w`,

    .. math:: t = k s / \max(1, w\, k |s|),

    and the anchor follows, as in Coulomb's law. At ``weakness = 0`` this is `Rough`.

    Parameters
    ----------
    weakness : float
        Inverse of the shear strength (1/MPa).
    stiffness : float
        Of the stick (MPa/mm).
    """

    weakness: Scalar
    stiffness: Scalar

    def __post_init__(self) -> None:
        """Check both numbers."""
        check_positive(self, "weakness", zero_allowed=True)
        check_positive(self, "stiffness")

    def traction(self, slip: Expr, pressure: Expr) -> Expr:
        """Return the traction, limited by the strength."""
        trial = self.stiffness * ufl.sqrt(ufl.dot(slip, slip) + 1e-24)
        return self.stiffness * slip / ufl.max_value(1, self.weakness * trial)

r"""Contact of the skin with a rigid indenter: laws of pressure and traction, settings.

With the gap :math:`g` of `legfem.mechanics.indenters`, the overclosure is :math:`h = -g` and the pressure :math:`p(h)`
acts along the gradient of the gap. All laws are per unit of the skin's reference area and take or give UFL expressions.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import ufl

from legfem.common.errors import AboveZero, Checked
from legfem.mechanics.kinematics import Expr

Scalar = Any


class PressureLaw(Protocol):
    """Contact pressure as a function of overclosure."""

    @property
    def onset(self) -> Scalar:
        """Gap (mm) below which there is pressure."""

    def pressure(self, overclosure: Expr) -> Expr:
        """Return the pressure (MPa) at an overclosure (mm, negative across an open gap)."""


@dataclass(frozen=True)
class ExponentialPressure(Checked):
    r"""Abaqus' exponential pressure-overclosure law.

    .. math:: p = \frac{p_0}{e - 1}
              \left[\left(\frac{h}{c_0} + 1\right)\left(e^{h / c_0 + 1} - 1\right)\right],
              \quad h > -c_0

    and zero below. The pressure is :math:`p_0` at :math:`h = 0`. Beyond :math:`h = 6 c_0` the law
    goes on along its tangent, so that a trial state far inside the indenter stays finite.

    Parameters
    ----------
    p0 : float
        Pressure at zero overclosure (MPa).
    c0 : float
        Gap at which the pressure vanishes (mm).
    """

    p0: AboveZero[Scalar]
    c0: AboveZero[Scalar]

    @property
    def onset(self) -> Scalar:
        """Gap (mm) below which there is pressure."""
        return self.c0

    def pressure(self, overclosure: Expr) -> Expr:
        """Return the pressure (MPa)."""
        limit = 7.0
        z = overclosure / self.c0 + 1
        bounded = ufl.max_value(0, ufl.min_value(z, limit))
        tangent = (limit + 1) * math.exp(limit) - 1
        beyond = tangent * ufl.max_value(z - limit, 0)
        return self.p0 / (math.e - 1) * (bounded * (ufl.exp(bounded) - 1) + beyond)


@dataclass(frozen=True)
class StiffPressure(Checked):
    r"""A linear penalty, rounded where it starts.

    .. math:: p = \begin{cases} 0 & h < -w \\ k (h + w)^2 / (4 w) & |h| \le w \\
              k h & h > w \end{cases}

    Parameters
    ----------
    stiffness : float
        :math:`k` (MPa/mm).
    width : float
        :math:`w` (mm), half of the interval over which the stiffness grows from zero.
    """

    stiffness: AboveZero[Scalar]
    width: AboveZero[Scalar]

    @property
    def onset(self) -> Scalar:
        """Gap (mm) below which there is pressure."""
        return self.width

    def pressure(self, overclosure: Expr) -> Expr:
        """Return the pressure (MPa)."""
        h, w = overclosure, self.width
        rounded = ufl.max_value(h + w, 0) ** 2 / (4 * w)
        return self.stiffness * ufl.conditional(ufl.gt(h, w), h, rounded)


class TangentialLaw(Protocol):
    """Traction along the indenter's surface as a function of elastic slip."""

    def traction(self, slip: Expr, pressure: Expr) -> Expr:
        """Return the traction (MPa) for the slip (mm) from the anchor."""


@dataclass(frozen=True)
class Frictionless:
    """No traction along the surface."""

    def traction(self, slip: Expr, pressure: Expr) -> Expr:
        """Return zero traction: nothing resists slip."""
        return 0 * slip


@dataclass(frozen=True)
class Rough(Checked):
    """No sliding: a point that touches stays where it touched, held by a stiff spring.

    Parameters
    ----------
    stiffness : float
        Stiffness of the spring, MPa/mm.
    """

    stiffness: AboveZero[Scalar]

    def traction(self, slip: Expr, pressure: Expr) -> Expr:
        """Return ``stiffness * slip``, MPa."""
        return self.stiffness * slip


@dataclass(frozen=True)
class Coulomb(Checked):
    r"""Coulomb friction: stick up to :math:`\mu p`, then slip (radial return of the anchor).

    Parameters
    ----------
    friction : float
        Coefficient :math:`\mu`.
    stiffness : float
        Stiffness of the stick, MPa/mm.
    """

    friction: AboveZero[Scalar]
    stiffness: AboveZero[Scalar]

    def traction(self, slip: Expr, pressure: Expr) -> Expr:
        """Return the traction, limited by ``friction * pressure``."""
        trial = self.stiffness * ufl.sqrt(ufl.dot(slip, slip) + 1e-24)
        limit = self.friction * pressure
        return self.stiffness * slip * ufl.conditional(ufl.lt(trial, limit), 1, limit / trial)


TangentialName = Literal["rough", "frictionless", "coulomb"]
PENALTY_PARAMETERS = ("deep.C10", "deep.C20", "superficial.C10")
"""Stiffnesses of a leg whose sum the penalty is in proportion to."""


@dataclass(frozen=True)
class ContactSettings(Checked):
    r"""Laws of contact, their stiffness relative to the tissue's.

    Parameters
    ----------
    normal : {"stiff", "exponential"}
        Law of the pressure: a rounded linear penalty, or Abaqus' exponential law.
    tangential : {"rough", "frictionless", "coulomb"}
        Law along the surface; the paper's tape is ``"rough"``.
    stiffness : float
        Dimensionless: the penalty is ``stiffness * mu / radius`` (MPa/mm) with the tissue's
        :math:`\mu = 2 (C_{10}^{deep} + C_{20}^{deep} + C_{10}^{superficial})`. The exponential law
        takes :math:`p_0` as the penalty times :math:`c_0`.
    onset : float
        Gap at which the pressure starts (mm).
    friction : float
        Coulomb's coefficient.
    stiffnesses : tuple of str
        Full names of those whose sum the penalty is in proportion to; a leg's by default.
    """

    normal: Literal["stiff", "exponential"] = "stiff"
    tangential: TangentialName = "rough"
    stiffness: float = 1000.0
    onset: float = 0.005
    friction: float = 0.5
    stiffnesses: tuple[str, ...] = PENALTY_PARAMETERS

    def penalty(self, parameters: Mapping[str, float], radius: float) -> float:
        """Return the penalty (MPa/mm) for a leg's parameters and the indenter's radius (mm)."""
        stiffness = sum(parameters.get(name, 0.0) for name in self.stiffnesses)
        return self.stiffness * 2 * stiffness / radius

    def penalty_slope(self, radius: float) -> float:
        """Return the penalty's derivative (1/mm) by each of the stiffnesses."""
        return self.stiffness * 2 / radius

    def pressure_law(self, penalty: float) -> PressureLaw:
        """Return the law of the pressure for a penalty stiffness, MPa/mm."""
        if self.normal == "stiff":
            return StiffPressure(penalty, self.onset)
        return ExponentialPressure(penalty * self.onset, self.onset)

    def tangential_law(self, penalty: float) -> TangentialLaw:
        """Return the law of the traction along the surface for a penalty stiffness, MPa/mm."""
        if self.tangential == "rough":
            return Rough(penalty)
        if self.tangential == "coulomb":
            return Coulomb(self.friction, penalty)
        return Frictionless()

r"""Contact of the skin with a rigid indenter: signed distance and pressure laws.

The indenter is an analytic signed distance, so no search for contact is needed. With :math:`y` the
position of a skin point relative to the indenter, the gap is :math:`g(y)`, the overclosure
:math:`h = -g` and the pressure :math:`p(h)` acts along the gradient of the gap.

All laws are per unit of the skin's reference area and take or give UFL expressions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real
from typing import Any, Protocol

import ufl

from legfem.common.errors import InputError, check_positive
from legfem.mechanics.kinematics import Expr

Scalar = Any


class RigidIndenter(Protocol):
    """A rigid body as the signed distance from its surface."""

    def gap(self, y: Expr) -> Expr:
        """Return the signed distance (mm) of a point relative to the indenter's centre."""

    def normal(self, y: Expr) -> Expr:
        """Return the gradient of the gap, a unit vector out of the indenter."""


@dataclass(frozen=True)
class RigidCylinder:
    """A rigid cylinder; in plane strain a disk.

    Parameters
    ----------
    radius : float
        mm.
    """

    radius: Scalar

    def gap(self, y: Expr) -> Expr:
        """Return the signed distance (mm) of a point at ``y`` from the axis, positive outside."""
        return ufl.sqrt(ufl.dot(y, y)) - self.radius

    def normal(self, y: Expr) -> Expr:
        """Return the gradient of the gap, a unit vector out of the indenter."""
        return y / ufl.sqrt(ufl.dot(y, y))


@dataclass(frozen=True)
class RigidBall(RigidCylinder):
    """A rigid ball, in 3D or in the meridional half plane: there it is a disk too.

    Parameters
    ----------
    radius : float
        mm.
    """


@dataclass(frozen=True)
class RigidPlate:
    """A rigid flat plate that reaches everywhere and faces down the second coordinate."""

    def gap(self, y: Expr) -> Expr:
        """Return the signed distance (mm) of a point at ``y`` from the plate's face."""
        return -y[1]

    def normal(self, y: Expr) -> Expr:
        """Return the gradient of the gap, a unit vector out of the plate."""
        return ufl.as_vector([-1.0 if k == 1 else 0.0 for k in range(y.ufl_shape[0])])


@dataclass(frozen=True)
class FiniteCylinder:
    r"""A rigid cylinder with its axis along the third coordinate and rounded end edges.

    With the distance :math:`s` from the axis, :math:`a = s - (r - \rho)` and
    :math:`b = |z| - (l - \rho)`, the signed distance is

    .. math:: g = \sqrt{\max(a, 0)^2 + \max(b, 0)^2} + \min(\max(a, b), 0) - \rho,

    which along the cylinder is that of `RigidCylinder`.

    Parameters
    ----------
    radius : float
        mm.
    half_length : float
        :math:`l` (mm), the rounding included.
    edge : float
        Radius :math:`\rho` of the rounding (mm).
    """

    radius: Scalar
    half_length: Scalar
    edge: Scalar

    def __post_init__(self) -> None:
        """Check the numbers, and that the rounding fits the cylinder."""
        check_positive(self, "radius", "half_length", "edge")
        numbers = (self.edge, self.radius, self.half_length)
        if all(isinstance(n, Real) for n in numbers) and self.edge >= min(numbers[1:]):
            raise InputError(
                "cylinder",
                "edge",
                f"a rounding of {self.edge:g} mm doesn't fit the cylinder",
                "give less than its radius and half its length",
            )

    def gap(self, y: Expr) -> Expr:
        """Return the signed distance (mm), positive outside."""
        return rounded_gap(*self._beyond(y), self.edge)

    def normal(self, y: Expr) -> Expr:
        """Return the gradient of the gap, a unit vector out of the indenter."""
        radial, axial = rounded_normal(*self._beyond(y))
        s = _norm(y[0], y[1])
        return ufl.as_vector([radial * y[0] / s, radial * y[1] / s, axial * ufl.conditional(ufl.lt(y[2], 0), -1, 1)])

    def _beyond(self, y: Expr) -> tuple[Expr, Expr]:
        a = _norm(y[0], y[1]) - (self.radius - self.edge)
        b = abs(y[2]) - (self.half_length - self.edge)
        return a, b


def rounded_gap(a: Expr, b: Expr, edge: Scalar) -> Expr:
    """Return the signed distance (mm) from a corner rounded with a radius, positive outside.

    Its faces lie that radius beyond ``a = 0`` and ``b = 0``, where a and b (mm) grow outwards.
    """
    corner = _norm(ufl.max_value(a, 0), ufl.max_value(b, 0))
    return corner + ufl.min_value(ufl.max_value(a, b), 0) - edge


def rounded_normal(a: Expr, b: Expr) -> tuple[Expr, Expr]:
    """Return the derivatives of `rounded_gap` by a and b; inside, those of the nearer face."""
    corner = _norm(ufl.max_value(a, 0), ufl.max_value(b, 0))
    inside = ufl.lt(ufl.max_value(a, b), 0)
    return (
        ufl.conditional(inside, _step(a - b), ufl.max_value(a, 0) / corner),
        ufl.conditional(inside, 1.0 - _step(a - b), ufl.max_value(b, 0) / corner),
    )


def _norm(a: Expr, b: Expr) -> Expr:
    """Return the length of (a, b), with a derivative at zero too."""
    return ufl.sqrt(a**2 + b**2 + 1e-24)


def _step(a: Expr) -> Expr:
    return ufl.conditional(ufl.gt(a, 0), 1.0, 0.0)


class PressureLaw(Protocol):
    """Contact pressure as a function of overclosure."""

    @property
    def onset(self) -> Scalar:
        """Gap (mm) below which there is pressure."""

    def pressure(self, overclosure: Expr) -> Expr:
        """Return the pressure (MPa) at an overclosure (mm, negative across an open gap)."""

    def scaled(self, factor: float) -> PressureLaw:
        """Return a law that is ``factor`` times stiffer, with the same shape."""


@dataclass(frozen=True)
class ExponentialPressure:
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

    p0: Scalar
    c0: Scalar

    def __post_init__(self) -> None:
        """Check that both numbers are positive."""
        check_positive(self, "p0", "c0")

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

    def scaled(self, factor: float) -> ExponentialPressure:
        """Return the law with ``p0`` multiplied."""
        return ExponentialPressure(self.p0 * factor, self.c0)


@dataclass(frozen=True)
class StiffPressure:
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

    stiffness: Scalar
    width: Scalar

    def __post_init__(self) -> None:
        """Check that both numbers are positive."""
        check_positive(self, "stiffness", "width")

    @property
    def onset(self) -> Scalar:
        """Gap (mm) below which there is pressure."""
        return self.width

    def pressure(self, overclosure: Expr) -> Expr:
        """Return the pressure (MPa)."""
        h, w = overclosure, self.width
        rounded = ufl.max_value(h + w, 0) ** 2 / (4 * w)
        return self.stiffness * ufl.conditional(ufl.gt(h, w), h, rounded)

    def scaled(self, factor: float) -> StiffPressure:
        """Return the law with its stiffness multiplied."""
        return StiffPressure(self.stiffness * factor, self.width)

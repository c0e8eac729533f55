"""Rigid indenters as analytic signed distances, so that no search for contact is needed.

With :math:`y` the position of a skin point relative to the indenter, the gap is :math:`g(y)`.
"""

from dataclasses import dataclass
from numbers import Real
from typing import Any, Protocol

import ufl

from legfem.common.errors import AboveZero, Checked, InputError
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
        Radius, mm.
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
        Radius, mm.
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
class FiniteCylinder(Checked):
    r"""A rigid cylinder with rounded end edges.

    With the distance :math:`s` from the axis and the place :math:`z` along it, :math:`a = s - (r - \rho)` and
    :math:`b = |z| - (l - \rho)`, the signed distance is

    .. math:: g = \sqrt{\max(a, 0)^2 + \max(b, 0)^2} + \min(\max(a, b), 0) - \rho,

    which along the cylinder is that of `RigidCylinder`.

    Parameters
    ----------
    radius : float
        Radius, mm.
    half_length : float
        :math:`l` (mm), the rounding included.
    edge : float
        Radius :math:`\rho` of the rounding (mm).
    axis_x, axis_y, axis_z : float
        Components of the axis' unit vector; along the third coordinate without them.
    """

    radius: AboveZero[Scalar]
    half_length: AboveZero[Scalar]
    edge: AboveZero[Scalar]
    axis_x: Scalar = 0.0
    axis_y: Scalar = 0.0
    axis_z: Scalar = 1.0

    def __post_init__(self) -> None:
        """Check the numbers, and that the rounding fits the cylinder."""
        super().__post_init__()
        numbers = (self.edge, self.radius, self.half_length)
        if all(isinstance(n, Real) for n in numbers) and self.edge >= min(numbers[1:]):
            problem = f"a rounding of {self.edge:g} mm doesn't fit the cylinder"
            raise InputError("cylinder", "edge", problem, "give less than its radius and half its length")

    def gap(self, y: Expr) -> Expr:
        """Return the signed distance (mm), positive outside."""
        return rounded_gap(*self._beyond(y), self.edge)

    def normal(self, y: Expr) -> Expr:
        """Return the gradient of the gap, a unit vector out of the indenter."""
        radial, axial = rounded_normal(*self._beyond(y))
        axis, along, across = self._parts(y)
        return radial / _length(across) * across + axial * ufl.conditional(ufl.lt(along, 0), -1, 1) * axis

    def _beyond(self, y: Expr) -> tuple[Expr, Expr]:
        _, along, across = self._parts(y)
        return _length(across) - (self.radius - self.edge), abs(along) - (self.half_length - self.edge)

    def _parts(self, y: Expr) -> tuple[Expr, Expr, Expr]:
        """Return the axis, how far a position lies along it, and the rest of the position, perpendicular to it."""
        axis = ufl.as_vector([self.axis_x, self.axis_y, self.axis_z])
        along = ufl.dot(y, axis)
        return axis, along, y - along * axis


def rounded_gap(a: Expr, b: Expr, edge: Scalar) -> Expr:
    """Return the signed distance (mm) from a corner rounded with a radius, positive outside.

    Its faces lie that radius beyond ``a = 0`` and ``b = 0``, where a and b (mm) grow outwards.
    """
    corner = _length(ufl.as_vector([ufl.max_value(a, 0), ufl.max_value(b, 0)]))
    return corner + ufl.min_value(ufl.max_value(a, b), 0) - edge


def rounded_normal(a: Expr, b: Expr) -> tuple[Expr, Expr]:
    """Return the derivatives of `rounded_gap` by a and b; inside, those of the nearer face."""
    corner = _length(ufl.as_vector([ufl.max_value(a, 0), ufl.max_value(b, 0)]))
    inside = ufl.lt(ufl.max_value(a, b), 0)
    return (
        ufl.conditional(inside, _step(a - b), ufl.max_value(a, 0) / corner),
        ufl.conditional(inside, 1.0 - _step(a - b), ufl.max_value(b, 0) / corner),
    )


def _length(vector: Expr) -> Expr:
    """Return the length of a vector, with a derivative at zero too."""
    return ufl.sqrt(ufl.dot(vector, vector) + 1e-24)


def _step(a: Expr) -> Expr:
    return ufl.conditional(ufl.gt(a, 0), 1.0, 0.0)

"""A finite cylinder whose axis lies along any direction."""

from __future__ import annotations

from dataclasses import dataclass

import ufl

from legfem.mechanics.contact import FiniteCylinder, Scalar, rounded_normal
from legfem.mechanics.kinematics import Expr


@dataclass(frozen=True)
class TurnedCylinder(FiniteCylinder):
    """A rigid cylinder with rounded end edges and its axis along a unit vector.

    See `FiniteCylinder`, which it is where the axis is the third coordinate's.

    Parameters
    ----------
    radius, half_length, edge : float
        mm.
    axis_x, axis_y, axis_z : float
        Of the unit vector.
    """

    axis_x: Scalar = 0.0
    axis_y: Scalar = 0.0
    axis_z: Scalar = 1.0

    def normal(self, y: Expr) -> Expr:
        """Return the gradient of the gap, a unit vector out of the indenter."""
        radial, axial = rounded_normal(*self._beyond(y))
        side = ufl.conditional(ufl.lt(self._along(y), 0), -1, 1)
        return radial / self._away(y) * self._across(y) + axial * side * self._axis

    @property
    def _axis(self) -> Expr:
        return ufl.as_vector([self.axis_x, self.axis_y, self.axis_z])

    def _along(self, y: Expr) -> Expr:
        return ufl.dot(y, self._axis)

    def _across(self, y: Expr) -> Expr:
        """Return the part of a position that is square to the axis."""
        return y - self._along(y) * self._axis

    def _away(self, y: Expr) -> Expr:
        """Return the distance from the axis, with a derivative on it too."""
        across = self._across(y)
        return ufl.sqrt(ufl.dot(across, across) + 1e-24)

    def _beyond(self, y: Expr) -> tuple[Expr, Expr]:
        a = self._away(y) - (self.radius - self.edge)
        b = abs(self._along(y)) - (self.half_length - self.edge)
        return a, b

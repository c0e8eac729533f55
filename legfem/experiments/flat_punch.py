"""A rigid flat-ended cylinder pressed end-on into a layer on a rigid base."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real
from typing import Any, Literal

import ufl

from legfem.common.errors import InputError, check_positive
from legfem.experiments.axisymmetric import Arrangement, AxisymmetricTest, Faces
from legfem.mechanics.contact import ContactSettings, rounded_gap, rounded_normal
from legfem.mechanics.kinematics import Expr
from legfem.meshing.meridian import MeridianMeshSettings, supports

Scalar = Any


@dataclass(frozen=True)
class RigidPunch:
    r"""A flat-ended cylinder that reaches upwards without end, in the meridional half plane.

    With :math:`a = r - (R - \rho)` and :math:`b = \rho - z` from the middle of the face, the signed
    distance is

    .. math:: g = \sqrt{\max(a, 0)^2 + \max(b, 0)^2} + \min(\max(a, b), 0) - \rho.

    Parameters
    ----------
    radius : float
        :math:`R` (mm), the rounding included.
    edge : float
        Radius :math:`\rho` of the rounding (mm).
    """

    radius: Scalar
    edge: Scalar

    def __post_init__(self) -> None:
        """Check the numbers, and that the face has a flat part."""
        check_positive(self, "radius", "edge")
        numbers = isinstance(self.edge, Real) and isinstance(self.radius, Real)
        if numbers and self.edge >= self.radius:
            raise InputError(
                "punch", "edge", f"a rounding of {self.edge:g} mm leaves no flat face", "give less than its radius"
            )

    def gap(self, y: Expr) -> Expr:
        """Return the signed distance (mm) of a point from the face's middle, positive outside."""
        return rounded_gap(*self._beyond(y), self.edge)

    def normal(self, y: Expr) -> Expr:
        """Return the gradient of the gap, a unit vector out of the punch."""
        radial, downwards = rounded_normal(*self._beyond(y))
        return ufl.as_vector([radial, -downwards])

    def _beyond(self, y: Expr) -> tuple[Expr, Expr]:
        return y[0] - (self.radius - self.edge), self.edge - y[1]


@dataclass(frozen=True)
class PunchOnLayer:
    """A rigid flat punch above a layer on a rigid base.

    Parameters
    ----------
    thickness : float
        Thickness of the layer, mm.
    radius : float
        Radius of the punch, the rounding of its edge included (mm).
    edge : float
        Radius of the rounding (mm).
    layer_radius : float
        Radius of the layer, whose side is free (mm).
    punch : {"rough", "frictionless"}
        Whether what touches the punch sticks.
    base : {"bonded", "sliding"}
        Whether the layer sticks to its base; it doesn't lift off in either case.
    """

    thickness: float
    radius: float = 5.0
    edge: float = 0.5
    layer_radius: float = 40.0
    punch: Faces = "rough"
    base: Literal["bonded", "sliding"] = "bonded"

    def __post_init__(self) -> None:
        """Check the sizes."""
        check_positive(self, "thickness", "radius", "edge", "layer_radius")
        RigidPunch(self.radius, self.edge)
        if self.layer_radius <= self.radius:
            raise InputError(
                "layer",
                "layer_radius",
                f"the punch of {self.radius:g} mm covers the layer",
                "give more than the punch's radius",
            )


class FlatPunchIndentation(AxisymmetricTest[PunchOnLayer]):
    """The punch's test; the mesh has elements of half of the rounding's radius at the edge."""

    @property
    def arrangement(self) -> Arrangement:
        """A punch above the layer."""
        test = self.test
        return Arrangement(
            RigidPunch(test.radius, test.edge),
            test.thickness,
            self.settings.contact or ContactSettings(tangential=test.punch, stiffness=4000.0),
            test.radius,
            supports(test.base),
            test.layer_radius,
            test.thickness,
            (test.radius - test.edge, test.radius + 0.5 * test.edge),
            self.settings.mesh or MeridianMeshSettings(0.5 * test.edge),
        )

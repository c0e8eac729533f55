"""A rigid flat-ended cylinder pressed end-on into a layer on a rigid base."""

from dataclasses import dataclass
from numbers import Real
from typing import Any

import ufl

from legfem.common.errors import AboveZero, Checked
from legfem.experiments.axisymmetric import Arrangement, AxisymmetricTest
from legfem.experiments.bodies import PunchOnLayer, check_rounding
from legfem.mechanics.contact import ContactSettings
from legfem.mechanics.indenters import rounded_gap, rounded_normal
from legfem.mechanics.kinematics import Expr
from legfem.meshing.structured import MeridianMeshSettings, supports

Scalar = Any


@dataclass(frozen=True)
class RigidPunch(Checked):
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

    radius: AboveZero[Scalar]
    edge: AboveZero[Scalar]

    def __post_init__(self) -> None:
        """Check the numbers, and that the face has a flat part."""
        super().__post_init__()
        if isinstance(self.edge, Real) and isinstance(self.radius, Real):
            check_rounding(float(self.radius), float(self.edge))

    def gap(self, y: Expr) -> Expr:
        """Return the signed distance (mm) of a point from the face's middle, positive outside."""
        return rounded_gap(*self._beyond(y), self.edge)

    def normal(self, y: Expr) -> Expr:
        """Return the gradient of the gap, a unit vector out of the punch."""
        radial, downwards = rounded_normal(*self._beyond(y))
        return ufl.as_vector([radial, -downwards])

    def _beyond(self, y: Expr) -> tuple[Expr, Expr]:
        return y[0] - (self.radius - self.edge), self.edge - y[1]


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

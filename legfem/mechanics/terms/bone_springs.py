"""A bone that is a rigid body on springs."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import ufl

from legfem.common.errors import check_positive
from legfem.mechanics.kinematics import Expr
from legfem.mechanics.model import Body, Memoryless, RegionTerm

HELD = 1e5
"""Stiffness (N/mm) at which a bone is as good as held: a leg's own is some newtons a mm."""
_RIGID = 1e3
"""Stiffness of the bone itself (MPa), which neither turns nor changes its shape."""
_PRESSURE = 1.0
"""Any modulus (MPa): a mixed form has pressures in the bone, too, where they are to vanish."""


@dataclass(frozen=True)
class BoneSprings(RegionTerm, Memoryless):
    r"""A bone that its springs let move as a whole, without turning.

    .. math:: W = \frac{k_x u_x^2 + k_y u_y^2}{2 A L} + \frac{B}{2} |\nabla u|^2

    a reference volume over the bone's section :math:`A`, with :math:`B` so large that :math:`u` is
    the same all over it; the springs' force on a length :math:`L` of the bone is then
    :math:`(k_x u_x, k_y u_y)`. Knee and ankle carry the bones, and hardly let them turn about their
    own axis. For a section whose mesh has the bone's inside.

    Parameters
    ----------
    region : str
        ``tibia`` or ``fibula``; parameters are named ``<region>.springs.x`` and so on.
    area : float
        Area of the bone's section, mm2.
    length : float
        Length of the leg that the springs hold (mm), as that of the cylinder that presses on it.
    x, y : float
        :math:`k_x, k_y` (N/mm).
    """

    region: str
    area: float
    length: float
    x: float = HELD
    y: float = HELD
    domain: Literal["body"] = "body"
    effect = "springs"
    numbers = ("x", "y")

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_positive(self, "area", "length", "x", "y")

    def residual(self, body: Body, history: Mapping[str, Any]) -> Expr:
        """Return the springs' virtual work, that of the rigid bone, and no pressure in it."""
        moved, varied = body.displacement, body.variation
        work = _RIGID * ufl.inner(ufl.grad(moved), ufl.grad(varied))
        for axis, (name, value) in enumerate(self.parameters.items()):
            stiffness = body.symbols.scalar(name, value)
            work += stiffness / (self.area * self.length) * moved[axis] * varied[axis]
        if self.region in body.pressures:
            pressure, by = body.pressures[self.region], body.pressure_variations[self.region]
            work -= pressure * by / _PRESSURE
        return work * body.regions[self.region]

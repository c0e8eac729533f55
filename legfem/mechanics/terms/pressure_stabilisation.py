"""What keeps a pressure of the displacement's degree from oscillating."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import ufl

from legfem.common.errors import InputError, check_positive
from legfem.mechanics.integration_domain import Body
from legfem.mechanics.kinematics import Expr
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.model import Memoryless, RegionTerm


@dataclass(frozen=True)
class PressureStabilisation(RegionTerm, Memoryless):
    r"""Polynomial pressure projection for linear displacements and pressures on simplices.

    Equal degrees fail the inf-sup condition. What of the pressure the constants :math:`\Pi p` of an
    element don't hold is penalised, with the shear modulus :math:`\mu = 2 C_{10}`:

    .. math:: -\frac{1}{2 \mu} \int (p - \Pi p)^2\, dV.

    It vanishes with the square of the element's size. P. B. Bochev, C. R. Dohrmann, M. D.
    Gunzburger, SIAM J. Numer. Anal. 44 (2006) 82-101; at finite strain J. A. White, R. I. Borja,
    Comput. Methods Appl. Mech. Eng. 197 (2008) 4353-4366.

    Parameters
    ----------
    region : str
        Region of the body.
    law : Hyperelastic
        The region's, whose symbol ``<region>.C10`` is shared.
    strength : float
        Factor on it, 1 in the source.
    """

    region: str
    law: Hyperelastic
    strength: float = 1.0
    domain: Literal["body"] = "body"
    effect = "stabilisation"
    numbers = ("strength",)

    def __post_init__(self) -> None:
        """Check the factor."""
        check_positive(self, "strength", zero_allowed=True)

    def residual(self, body: Body, history: Mapping[str, Any]) -> Expr:
        """Return the variation of the penalty."""
        if self.region not in body.pressures:
            raise InputError(
                "formulation", self.name, "there is no pressure to stabilise", 'choose the formulation "continuous"'
            )
        law = body.symbols.of(self.region, self.law)
        strength = body.symbols.scalar(f"{self.name}.strength", self.strength)
        rest = _variance(body.pressures[self.region])
        penalty = -strength / (4 * law.C10) * rest * body.regions[self.region]
        return ufl.derivative(penalty, body.unknown, body.test)

    def nominal_stress(self, body: Body) -> Expr:
        """Return zero: only the pressures' equation is changed."""
        return ufl.zero(3, 3)


def _variance(p: Expr) -> Expr:
    r"""Return the mean of :math:`(p - \Pi p)^2` over an element, for a linear :math:`p`.

    The barycentric coordinates of a simplex of dimension d have the variance
    :math:`d / ((d + 1)^2 (d + 2))` and, two of them, minus the d-th part of it.
    """
    domain = ufl.domain.extract_unique_domain(p)
    slope = ufl.dot(ufl.grad(p), ufl.Jacobian(domain))
    d = slope.ufl_shape[0]
    total = sum(slope[i] for i in range(d))
    return ((d + 1) * ufl.dot(slope, slope) - total**2) / ((d + 1) ** 2 * (d + 2))

"""Laws that stiffen with strain more than the reduced polynomial of second order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
import ufl

from legfem.common.errors import check_positive
from legfem.mechanics.kinematics import Expr, isochoric_first_invariant
from legfem.mechanics.materials.hyperelastic import Hyperelastic, ReducedPolynomial, Scalar


@dataclass(frozen=True)
class _Stiffening(ReducedPolynomial):
    """A reduced polynomial with one more term, which vanishes by default."""

    @classmethod
    def of(cls, law: Hyperelastic) -> Self:
        """Return the law that is another one until the further term counts."""
        return cls(**{"C20": 0.0, **law.parameters})


@dataclass(frozen=True)
class Yeoh(_Stiffening):
    r"""Reduced polynomial with a distortion term of third order: a tissue that stiffens late.

    .. math:: U = \sum_{i=1}^{3} C_{i0} (\bar I_1 - 3)^i + (J - 1)^2 / D_1 + (J - 1)^4 / D_2

    O. H. Yeoh, Rubber Chem. Technol. 66 (1993) 754-771. ``C30`` in MPa, null 0; the others as in
    `ReducedPolynomial`. In a model: ``model.with_term(Tissue("deep", Yeoh.of(law)))``.

    Raises
    ------
    InputError
        For impossible parameters; ``C30`` is zero or more.
    """

    C30: Scalar = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_positive(self, "C30", zero_allowed=True)

    def distortion_energy(self, F: Expr) -> Expr:
        r"""Return :math:`\sum_i C_{i0}(\bar I_1 - 3)^i` (MPa)."""
        return super().distortion_energy(F) + self.C30 * (isochoric_first_invariant(F) - 3) ** 3

    def distortion_slope(self, stretch: Scalar) -> Scalar:
        r"""Return :math:`\sum_i i C_{i0}(\bar I_1 - 3)^{i - 1}` (MPa)."""
        return super().distortion_slope(stretch) + 3 * self.C30 * stretch**2


@dataclass(frozen=True)
class ExponentialStiffening(_Stiffening):
    r"""Reduced polynomial with an exponential term: collagen that is drawn straight.

    .. math:: U = U_\text{reduced polynomial}
              + \frac{A}{b} \left(e^{b (\bar I_1 - 3)} - 1 - b (\bar I_1 - 3)\right)

    H. Demiray, J. Biomech. 5 (1972) 309-311, less its linear part: the stiffness at small strain
    stays :math:`2 C_{10}`.

    Parameters
    ----------
    stiffening : float
        :math:`A` (MPa), null 0.
    exponent : float
        :math:`b`, dimensionless.

    Raises
    ------
    InputError
        For impossible parameters; ``stiffening`` is zero or more, ``exponent`` more than zero.
    """

    stiffening: Scalar = 0.0
    exponent: Scalar = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_positive(self, "stiffening", zero_allowed=True)
        check_positive(self, "exponent")

    def distortion_energy(self, F: Expr) -> Expr:
        """Return the reduced polynomial's and the exponential term (MPa)."""
        grown = self.exponent * (isochoric_first_invariant(F) - 3)
        exponential = self.stiffening / self.exponent * (ufl.exp(grown) - 1 - grown)
        return super().distortion_energy(F) + exponential

    def distortion_slope(self, stretch: Scalar) -> Scalar:
        """Return the reduced polynomial's and the exponential term's (MPa)."""
        exponential = self.stiffening * np.expm1(self.exponent * stretch)
        return super().distortion_slope(stretch) + exponential

r"""Hyperelastic laws of the soft tissues.

Every law is the sum of three parts, so that a mixed displacement-pressure form can treat the stiff
one apart:

.. math:: U = U_\text{distortion}(\bar I_1) + (J - 1)^2 / D_1 + U_\text{remainder}(J).

Small strain: shear modulus :math:`\mu = 2 C_{10}`, bulk modulus :math:`K = 2 / D_1`.

The fields of a law are plain numbers where a user gives them, and UFL symbols once a model is put
on a mesh (:class:`legfem.fem.forms.Symbols`): the energies below serve both.
"""

import math
from dataclasses import dataclass, fields
from numbers import Real
from typing import Any, Self

import numpy as np
import ufl

from legfem.common.errors import AboveZero, Checked, InputError, ZeroOrMore
from legfem.mechanics.kinematics import Expr, isochoric_first_invariant, volume_ratio

Scalar = Any


@dataclass(frozen=True)
class Hyperelastic(Checked):
    """What all laws share: a compressibility ``D1`` (1/MPa) and the sum of the three parts."""

    C10: AboveZero[Scalar]
    D1: AboveZero[Scalar]

    def distortion_energy(self, F: Expr) -> Expr:
        r"""Return :math:`C_{10}(\bar I_1 - 3)` (MPa)."""
        return self.C10 * (isochoric_first_invariant(F) - 3)

    def distortion_slope(self, stretch: Scalar) -> Scalar:
        r"""Return :math:`d U_\text{distortion} / d \bar I_1` (MPa) at numbers of Ī1 - 3."""
        return self.C10 + 0 * stretch

    def volumetric_remainder(self, J: Expr) -> Expr:
        """Return what the volumetric energy has beyond the quadratic term (MPa)."""
        return 0

    def volumetric_slope(self, J: Scalar) -> Scalar:
        """Return the volumetric energy's derivative (MPa) at numbers of J."""
        return 2 * (J - 1) / self.D1

    def strain_energy(self, F: Expr) -> Expr:
        """Return the strain energy per unit reference volume (MPa)."""
        J = volume_ratio(F)
        quadratic = (J - 1) ** 2 / self.D1
        return self.distortion_energy(F) + quadratic + self.volumetric_remainder(J)

    @property
    def parameters(self) -> dict[str, Scalar]:
        """The law's parameters by the names of the field."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @property
    def shear_modulus(self) -> float:
        r""":math:`\mu = 2 C_{10}` (MPa)."""
        return 2 * self.C10

    @property
    def bulk_modulus(self) -> float:
        """``K = 2 / D1`` (MPa)."""
        return 2 / self.D1

    @property
    def poisson_ratio(self) -> float:
        """Poisson's ratio at small strain; negative where K is below 2/3 of the shear modulus."""
        K, mu = self.bulk_modulus, self.shear_modulus
        return (3 * K - 2 * mu) / (6 * K + 2 * mu)


@dataclass(frozen=True)
class NeoHookean(Hyperelastic):
    r"""Quasi-incompressible neo-Hookean law.

    .. math:: U = C_{10} (\bar I_1 - 3) + (J - 1)^2 / D_1

    Eq. 1 of Frauziols et al.; ``C10`` in MPa, ``D1`` in 1/MPa.

    Raises
    ------
    InputError
        If ``C10`` or ``D1`` is not a positive number.
    """


@dataclass(frozen=True)
class ReducedPolynomial(Hyperelastic):
    r"""Reduced polynomial law of second order.

    .. math:: U = C_{10} (\bar I_1 - 3) + C_{20} (\bar I_1 - 3)^2
                  + (J - 1)^2 / D_1 + (J - 1)^4 / D_2

    Eq. 2 of Frauziols et al.; ``C10``, ``C20`` in MPa, ``D1``, ``D2`` in 1/MPa. ``D2 = inf`` leaves
    the last term out.

    Raises
    ------
    InputError
        If ``C10``, ``D1`` or ``D2`` is not positive, or ``C20`` is negative.
    """

    C20: ZeroOrMore[Scalar]
    D2: Scalar = math.inf

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.D2, Real) and not float(self.D2) > 0:
            remedy = "give a value of more than zero, or leave it out"
            raise InputError(type(self).__name__, "D2", f"is {float(self.D2):g}", remedy)

    def distortion_energy(self, F: Expr) -> Expr:
        r"""Return :math:`C_{10}(\bar I_1 - 3) + C_{20}(\bar I_1 - 3)^2` (MPa)."""
        stretch = isochoric_first_invariant(F) - 3
        return self.C10 * stretch + self.C20 * stretch**2

    def distortion_slope(self, stretch: Scalar) -> Scalar:
        r"""Return :math:`C_{10} + 2 C_{20}(\bar I_1 - 3)` (MPa)."""
        return self.C10 + 2 * self.C20 * stretch

    def volumetric_remainder(self, J: Expr) -> Expr:
        """Return ``(J - 1)^4 / D2`` (MPa)."""
        return (J - 1) ** 4 / self.D2

    def volumetric_slope(self, J: Scalar) -> Scalar:
        """Return ``2 (J - 1) / D1 + 4 (J - 1)^3 / D2`` (MPa)."""
        return super().volumetric_slope(J) + 4 * (J - 1) ** 3 / self.D2


@dataclass(frozen=True)
class _Stiffening(ReducedPolynomial):
    """A reduced polynomial with one more term, which vanishes by default."""

    @classmethod
    def of(cls, law: Hyperelastic) -> Self:
        """Return the law that equals another one, its further term being at its null."""
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

    C30: ZeroOrMore[Scalar] = 0.0

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

    stiffening: ZeroOrMore[Scalar] = 0.0
    exponent: AboveZero[Scalar] = 1.0

    def distortion_energy(self, F: Expr) -> Expr:
        """Return the reduced polynomial's and the exponential term (MPa)."""
        grown = self.exponent * (isochoric_first_invariant(F) - 3)
        return super().distortion_energy(F) + self.stiffening / self.exponent * (ufl.exp(grown) - 1 - grown)

    def distortion_slope(self, stretch: Scalar) -> Scalar:
        """Return the reduced polynomial's and the exponential term's (MPa)."""
        return super().distortion_slope(stretch) + self.stiffening * np.expm1(self.exponent * stretch)

"""The energy of a tissue, volume that it loses when it is squeezed, and its pressure's stabilisation."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import ufl

from legfem.common.errors import InputError, ZeroOrMore
from legfem.mechanics.kinematics import Expr, nominal_stress, volume_ratio
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.model import Body, Memoryless, RegionTerm


class EnergyTerm(RegionTerm, Memoryless, ABC):
    """A term with an elastic energy: its variation, and the stress that follows from it."""

    @abstractmethod
    def energy_density(self, body: Body, F: Expr) -> Expr:
        """Return the energy a reference volume (MPa) at a deformation gradient."""

    def residual(self, body: Body, history: Mapping[str, Any]) -> Expr:
        """Return the variation of the energy."""
        energy = self.energy_density(body, body.deformation_gradient)
        return ufl.derivative(energy * body.regions[self.region], body.unknown, body.test)

    def nominal_stress(self, body: Body) -> Expr:
        """Return the first Piola-Kirchhoff stress (MPa)."""
        return nominal_stress(partial(self.energy_density, body), body.deformation_gradient)


class PressureTerm(RegionTerm, Memoryless, ABC):
    """A term that acts through a region's pressure alone, and so adds nothing to the stress."""

    @abstractmethod
    def work_density(self, body: Body, pressure: Expr) -> Expr:
        """Return the pressure's work a reference volume (MPa)."""

    def residual(self, body: Body, history: Mapping[str, Any]) -> Expr:
        """Return the variation of the work.

        Raises
        ------
        InputError
            If the form has no pressure in the region.
        """
        if self.region not in body.pressures:
            problem = "acts through a pressure, and there is none"
            raise InputError("formulation", self.name, problem, 'choose the formulation "continuous" or "mixed"')
        work = self.work_density(body, body.pressures[self.region]) * body.regions[self.region]
        return ufl.derivative(work, body.unknown, body.test)

    def nominal_stress(self, body: Body) -> Expr:
        """Return zero: the pressure's stress is the tissue's."""
        return ufl.zero(3, 3)


@dataclass(frozen=True)
class Tissue(EnergyTerm):
    """A hyperelastic region of the body."""

    law: Hyperelastic

    @property
    def name(self) -> str:
        """The region's name."""
        return self.region

    @property
    def parameters(self) -> dict[str, float]:
        """The law's parameters."""
        return {f"{self.region}.{key}": value for key, value in self.law.parameters.items()}

    def energy_density(self, body: Body, F: Expr) -> Expr:
        r"""Return the strain energy (MPa) at a deformation gradient.

        In a mixed form the quadratic part is that by Legendre:

        .. math:: (J - 1)^2 / D_1 \to p (J - 1) - D_1 p^2 / 4
        """
        law = body.symbols.of(self.region, self.law)
        pressure = body.pressures.get(self.region)
        if pressure is None:
            return law.strain_energy(F)
        J = volume_ratio(F)
        dual = pressure * (J - 1) - law.D1 * pressure**2 / 4
        return law.distortion_energy(F) + dual + law.volumetric_remainder(J)


@dataclass(frozen=True)
class VolumeLoss(PressureTerm):
    r"""A share of a region's volume leaves it, evenly: its pressure is zero at :math:`J = 1 - s`.

    .. math:: p (J - 1) - D_1 p^2 / 4 \to p (J - 1 + s) - D_1 p^2 / 4.

    What has left is gone for good, whatever the pressure: blood drained from the veins, not the
    filtration of a poroelastic tissue. Nothing happens at ``share = 0``. Needs a form with a
    pressure.

    Parameters
    ----------
    region : str
        Region of the body; the parameter is named ``<region>.volume_loss.share``.
    share : float
        Share :math:`s` of the volume that is lost, dimensionless.
    """

    share: float = 0.0
    effect = "volume_loss"
    numbers = ("share",)

    def work_density(self, body: Body, pressure: Expr) -> Expr:
        """Return the pressure's work on the volume that is lost, a reference volume (MPa)."""
        (share,) = self.scalars(body)
        return share * pressure


@dataclass(frozen=True)
class PressureStabilisation(PressureTerm):
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

    law: Hyperelastic
    strength: ZeroOrMore[float] = 1.0
    effect = "stabilisation"
    numbers = ("strength",)

    def work_density(self, body: Body, pressure: Expr) -> Expr:
        """Return the penalty a reference volume (MPa)."""
        law = body.symbols.of(self.region, self.law)
        (strength,) = self.scalars(body)
        return -strength / (4 * law.C10) * _variance(pressure)


def _variance(p: Expr) -> Expr:
    r"""Return the mean of :math:`(p - \Pi p)^2` over an element, for a linear :math:`p`.

    The barycentric coordinates of a simplex of dimension d have the variance
    :math:`d / ((d + 1)^2 (d + 2))` and, two of them, minus the d-th part of it.
    """
    slope = ufl.dot(ufl.grad(p), ufl.Jacobian(ufl.domain.extract_unique_domain(p)))
    d = slope.ufl_shape[0]
    total = sum(slope[i] for i in range(d))
    return ((d + 1) * ufl.dot(slope, slope) - total**2) / ((d + 1) ** 2 * (d + 2))

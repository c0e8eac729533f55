"""Muscle: its fibres, and its contraction."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
import ufl

from legfem.common.errors import InputError, check_positive
from legfem.common.units import FloatArray
from legfem.mechanics.kinematics import Expr, isochoric_first_invariant
from legfem.mechanics.model import Body
from legfem.mechanics.terms.tissue import EnergyTerm

ALONG_THE_LEG = (0.0, 0.0, 1.0)
USUAL_EXTENSION = 4.0
r"""Of :math:`E_L - 3 \mu_T` over :math:`\mu_L - \mu_T`: there the energy has no further term in
:math:`I_4^2`."""


@dataclass(frozen=True)
class Fibres(EnergyTerm):
    r"""Fibres of one direction make a region stiffer along them than across.

    To the region's energy is added, with :math:`a` the fibres' direction,
    :math:`I_4 = a \cdot C a` and :math:`I_5 = a \cdot C^2 a`,

    .. math:: \tfrac12 (\mu_L - \mu_T) (I_5 - I_4^2) + \tfrac18 (E_L - 3 \mu_T) (I_4 - 1)^2,

    the standard reinforcing model with both invariants, which has the three moduli of an
    incompressible, transversely isotropic solid: shear along the fibres :math:`\mu_L`, shear across
    :math:`\mu_T = 2 C_{10}`, Young's along :math:`E_L` (J. G. Murphy, Eur. J. Mech. A 42 (2013)
    90-96, with its terms collected). The invariants are those of the whole deformation
    (C. Sansour, Eur. J. Mech. A 27 (2008) 28-39), so fibres that don't move do no work: in plane
    strain fibres along the leg change nothing. Nothing happens at ``shear = 0, extension = 0``.

    Parameters
    ----------
    region : str
        Region of the body; parameters are named ``<region>.fibres.shear`` and ``.extension``.
    shear : float
        :math:`\mu_L - \mu_T` (MPa).
    extension : float
        :math:`E_L - 3 \mu_T` (MPa).
    axis : (3,) tuple
        Direction of the fibres; of unit length.
    """

    region: str
    shear: float = 0.0
    extension: float = 0.0
    axis: tuple[float, float, float] = ALONG_THE_LEG
    domain: Literal["body"] = "body"
    effect = "fibres"
    numbers = ("shear", "extension")

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_positive(self, "shear", "extension", zero_allowed=True)
        if not np.isclose(np.linalg.norm(self.axis), 1.0):
            raise InputError("Fibres", "axis", f"{self.axis} is not of unit length", "normalise it")

    @classmethod
    def of_ratio(
        cls, region: str, C10: float, ratio: float, axis: tuple[float, float, float] = ALONG_THE_LEG
    ) -> "Fibres":
        r"""Return fibres of a ratio of shear moduli, with :math:`E_L = 4 \mu_L - \mu_T`.

        See `USUAL_EXTENSION`.

        Parameters
        ----------
        region : str
            Region of the body.
        C10 : float
            C10 of the region's law, MPa.
        ratio : float
            :math:`\mu_L / \mu_T`, at least 1.
        axis : (3,) tuple
            Direction of the fibres.
        """
        shear = 2 * C10 * (ratio - 1)
        return cls(region, shear, USUAL_EXTENSION * shear, axis)

    @classmethod
    def slope_by_ratio(cls, region: str, C10: float, by: Mapping[str, FloatArray]) -> FloatArray:
        r"""Return the derivative by the ratio, C10 held, of what has derivatives by the moduli.

        .. math:: \frac{\partial F}{\partial r} = 2 C_{10} \left(\frac{\partial F}{\partial s}
                  + 4 \frac{\partial F}{\partial e}\right)

        with the shear s and the extension e.

        Parameters
        ----------
        region : str
            Region of the body.
        C10 : float
            C10 of the region's law, MPa.
        by : mapping
            Derivatives (n,) by shear and extension, 1/MPa, by the parameters' names.
        """
        one = cls.of_ratio(region, C10, 2.0).parameters
        return np.asarray(sum(value * by[name] for name, value in one.items()))

    def energy_density(self, body: Body, F: Expr) -> Expr:
        """Return the added energy (MPa) at a deformation gradient."""
        shear, extension = (body.symbols.scalar(name, value) for name, value in self.parameters.items())
        along = F.T * F * ufl.as_vector(self.axis)
        I4 = ufl.dot(ufl.as_vector(self.axis), along)
        return shear / 2 * (ufl.dot(along, along) - I4**2) + extension / 8 * (I4 - 1) ** 2


@dataclass(frozen=True)
class Contraction(EnergyTerm):
    r"""The muscle tenses from a moment on, and resists more.

    Fibres along the leg do no work in plane strain, so a contraction shows as a raised transverse
    stiffness. The energy

    .. math:: s(t)\, C\, (\bar I_1 - 3), \quad s = 3 x^2 - 2 x^3, \quad
              x = \min(\max((t - t_0) / r, 0), 1)

    is added to the region's, with a switch :math:`s` whose rate is continuous. The relaxed leg
    keeps its shape when it tenses. Nothing happens at ``stiffness = 0``, or before the onset.

    Parameters
    ----------
    region : str
        Region of the body; parameters are named ``<region>.contraction.stiffness`` and so on.
    stiffness : float
        :math:`C` (MPa), what C10 rises by.
    onset : float
        :math:`t_0` (s), of the protocol's clock.
    rise : float
        :math:`r` (s), from the onset to the full contraction.
    """

    region: str
    stiffness: float = 0.0
    onset: float = 0.0
    rise: float = 1.0
    domain: Literal["body"] = "body"
    effect = "contraction"
    numbers = ("stiffness", "onset", "rise")

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_positive(self, "stiffness", zero_allowed=True)
        check_positive(self, "rise")

    def energy_density(self, body: Body, F: Expr) -> Expr:
        """Return the added energy (MPa) at a deformation gradient."""
        stiffness, onset, rise = (body.symbols.scalar(name, value) for name, value in self.parameters.items())
        x = ufl.max_value(0, ufl.min_value(1, (body.time - onset) / rise))
        return stiffness * x**2 * (3 - 2 * x) * (isochoric_first_invariant(F) - 3)

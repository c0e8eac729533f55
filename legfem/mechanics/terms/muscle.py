"""Muscle: its fibres, its contraction, and a stiffness that isn't the same everywhere."""

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
import ufl

from legfem.common.errors import AboveZero, InputError, ZeroOrMore
from legfem.common.units import FloatArray
from legfem.mechanics.kinematics import Expr
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.model import Body
from legfem.mechanics.terms.tissue import EnergyTerm

ALONG_THE_LEG = (0.0, 0.0, 1.0)
USUAL_EXTENSION = 4.0
r"""Value of :math:`E_L - 3 \mu_T` over :math:`\mu_L - \mu_T` that is usual: there the energy has no further term in
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

    shear: ZeroOrMore[float] = 0.0
    extension: ZeroOrMore[float] = 0.0
    axis: tuple[float, float, float] = ALONG_THE_LEG
    effect = "fibres"
    numbers = ("shear", "extension")

    def __post_init__(self) -> None:
        """Check the numbers."""
        super().__post_init__()
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

    def energy_density(self, body: Body, F: Expr) -> Expr:
        """Return the added energy (MPa) at a deformation gradient."""
        shear, extension = self.scalars(body)
        along = F.T * F * ufl.as_vector(self.axis)
        I4 = ufl.dot(ufl.as_vector(self.axis), along)
        return shear / 2 * (ufl.dot(along, along) - I4**2) + extension / 8 * (I4 - 1) ** 2


_EDGE = 12.0
"""Sharpness of a lump's edge: nine tenths of it lie within a fifth of the radius, which a mesh that doesn't know the
lump can integrate. A soft edge is hard as well where the excess is great, and makes the lump larger than it is."""


@dataclass(frozen=True)
class _Unlike(EnergyTerm):
    """What of a region's distortion energy is more, or less, from place to place.

    Parameters
    ----------
    region : str
        Region of the body.
    law : Hyperelastic
        The region's, whose symbols are shared.
    """

    law: Hyperelastic

    @abstractmethod
    def share(self, position: Expr, *numbers: Expr) -> Expr:
        """Return how much more, as a share, at a reference position (mm) with the term's parameters."""

    def energy_density(self, body: Body, F: Expr) -> Expr:
        """Return what is added to the energy (MPa) at a deformation gradient."""
        position = ufl.SpatialCoordinate(ufl.domain.extract_unique_domain(body.displacement))
        return self.share(position, *self.scalars(body)) * body.symbols.of(self.region, self.law).distortion_energy(F)


@dataclass(frozen=True)
class StiffnessGradient(_Unlike):
    r"""What of the distortion energy is more above a level, and less below it.

    .. math:: g\, \frac{z - z_0}{\ell}\, U_\text{distortion}

    is added to the region's energy; nothing happens at ``gradient = 0``. At the ankle tendons make
    the deep tissue stiffer than at the calf.

    Parameters
    ----------
    region : str
        Region of the body; parameters are named ``<region>.stiffness_gradient.gradient`` and so on.
    law : Hyperelastic
        The region's, whose symbols are shared.
    level : float
        :math:`z_0` (mm).
    gradient : float
        :math:`g`, relative change over the length.
    length : float
        :math:`\ell` (mm).
    """

    level: float
    gradient: float = 0.0
    length: AboveZero[float] = 100.0
    effect = "stiffness_gradient"
    numbers = ("gradient", "level", "length")

    def share(self, position: Expr, *numbers: Expr) -> Expr:
        """Return it in proportion to the height."""
        gradient, level, length = numbers
        return gradient * (position[len(position) - 1] - level) / length


@dataclass(frozen=True)
class Excess(EnergyTerm):
    r"""What of the distortion energy is more in a region within another: :math:`e\, U_\text{distortion}`.

    It is added to the energy of the region around, of which it is a part; nothing happens at ``excess = 0``.

    Parameters
    ----------
    region : str
        Region of the body; the parameter is named ``<region>.stiffness.excess``.
    within : str
        The region around.
    law : Hyperelastic
        That region's, whose symbols are shared.
    excess : float
        :math:`e`.
    """

    within: str
    law: Hyperelastic
    excess: float = 0.0
    effect = "stiffness"
    numbers = ("excess",)

    def energy_density(self, body: Body, F: Expr) -> Expr:
        """Return what is added to the energy (MPa) at a deformation gradient."""
        (excess,) = self.scalars(body)
        return excess * body.symbols.of(self.within, self.law).distortion_energy(F)


@dataclass(frozen=True)
class UnevenStiffness(_Unlike):
    r"""What of the distortion energy is more about some points of a region.

    .. math:: \sum_k \frac{e_k}{1 + \exp(12 (|X - X_k|^2 / r_k^2 - 1))} U_\text{distortion}

    is added to the region's energy; nothing happens where all excesses :math:`e_k` are zero. One
    point is a lump that is as much as a disk of radius :math:`r_k` in section.

    Parameters
    ----------
    region : str
        Region of the body; parameters are named ``<region>.uneven_stiffness.excess1`` and so on.
    law : Hyperelastic
        The region's, whose symbols are shared.
    points : tuple of tuples of float
        Reference positions :math:`X_k` (mm), two or three coordinates each.
    radii : tuple of float
        :math:`r_k` (mm).
    """

    points: tuple[tuple[float, ...], ...]
    radii: AboveZero[tuple[float, ...]]
    effect = "uneven_stiffness"

    @property
    def parameters(self) -> dict[str, float]:
        """The excesses, all zero."""
        return {f"{self.name}.excess{k + 1}": 0.0 for k in range(len(self.points))}

    def share(self, position: Expr, *numbers: Expr) -> Expr:
        """Return the sum over the points."""
        each = zip(self.points, self.radii, numbers, strict=True)
        return sum(strength * _near(position - ufl.as_vector(point), radius) for point, radius, strength in each)


@dataclass(frozen=True)
class StiffnessField(_Unlike):
    r"""Distortion energy that is more here and less there: :math:`(\exp f(X) - 1)\, U_\text{distortion}`.

    .. math:: f(X) = \sum_{jk} a_{jk} \sin\frac{j \pi (x - x_0)}{\ell} \sin\frac{k \pi (y - y_0)}{\ell}

    with the sines of a square, :math:`j^2 + k^2 \le n^2`; nothing happens where all are zero, nor outside the square.

    Parameters
    ----------
    region : str
        Region of a body in section; parameters are named ``<region>.stiffness_field.a1_1`` and so on.
    law : Hyperelastic
        The region's, whose symbols are shared.
    left, bottom, side : float
        The square's corner :math:`x_0, y_0` and :math:`\ell` (mm).
    finest : int
        :math:`n`.
    """

    left: float
    bottom: float
    side: AboveZero[float]
    finest: int = 8
    effect = "stiffness_field"
    numbers = ("left", "bottom", "side")

    @property
    def waves(self) -> list[tuple[int, int]]:
        """The sines' j and k."""
        each = range(1, self.finest + 1)
        return [(j, k) for j in each for k in each if j**2 + k**2 <= self.finest**2]

    @property
    def modes(self) -> list[str]:
        """Full names of the sines' coefficients."""
        return [f"{self.name}.a{j}_{k}" for j, k in self.waves]

    @property
    def parameters(self) -> dict[str, float]:
        """The square and the coefficients; as numbers of a form the square would have each leg's compiled anew."""
        return super().parameters | dict.fromkeys(self.modes, 0.0)

    def sines(self, points: FloatArray) -> FloatArray:
        """Return the sines (n, m) at points (n, 2), mm."""
        along = np.pi * np.clip((points - (self.left, self.bottom)) / self.side, 0.0, 1.0)
        return np.prod(np.sin(along[:, None] * np.array(self.waves)), axis=-1)

    def share(self, position: Expr, *numbers: Expr) -> Expr:
        """Return what the field adds."""
        *corner, side = numbers[:3]
        # Clipped, as every sine is zero at the square's edge.
        along = [ufl.min_value(ufl.max_value((x - low) / side, 0), 1) for x, low in zip(position, corner, strict=True)]
        u, v = (np.pi * one for one in along)
        each = zip(numbers[3:], self.waves, strict=True)
        return ufl.exp(sum(size * ufl.sin(j * u) * ufl.sin(k * v) for size, (j, k) in each)) - 1


@dataclass(frozen=True)
class StiffLump(_Unlike):
    r"""What of the distortion energy is more about one point, which parameters place.

    As :class:`UnevenStiffness` about a single point: :math:`X_1` lies at a depth along a direction
    from an origin, and to the left of it.

    Parameters
    ----------
    region : str
        Region of a body in section; parameters are named ``<region>.stiff_lump.excess`` and so on.
    law : Hyperelastic
        The region's, whose symbols are shared.
    origin : tuple of float
        Where depths begin (mm).
    direction : tuple of float
        Unit vector along which they are.
    excess : float
        :math:`e_1`.
    depth, side, radius : float
        Of the lump (mm); its radius is :math:`r_1`.
    """

    origin: tuple[float, float]
    direction: tuple[float, float]
    excess: float = 0.0
    depth: float = 0.0
    side: float = 0.0
    radius: AboveZero[float] = 1.0
    effect = "stiff_lump"
    numbers = ("excess", "depth", "side", "radius")

    def share(self, position: Expr, *numbers: Expr) -> Expr:
        """Return it about the point."""
        excess, depth, side, radius = numbers
        x, y = self.direction
        away = position - ufl.as_vector(self.origin) - depth * ufl.as_vector((x, y)) - side * ufl.as_vector((-y, x))
        return excess * _near(away, radius)


def _near(away: Expr, radius: Expr | float) -> Expr:
    # As 1 / (1 + exp), which overflows far away.
    return 0.5 * (1 - ufl.tanh(0.5 * _EDGE * (ufl.dot(away, away) / radius**2 - 1)))

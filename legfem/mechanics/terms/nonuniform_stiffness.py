"""Tissues whose stiffness varies: along the leg, or from place to place."""

from dataclasses import dataclass
from typing import Literal

import ufl

from legfem.common.errors import check_positive
from legfem.mechanics.kinematics import Expr
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.model import Body
from legfem.mechanics.terms.tissue import EnergyTerm

_EDGE = 12.0
"""Sharpness of a lump's edge: nine tenths of it lie within a fifth of the radius, which a mesh that doesn't know the
lump can integrate. A soft edge is hard as well where the excess is great, and makes the lump larger than it is."""


@dataclass(frozen=True)
class StiffnessGradient(EnergyTerm):
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

    region: str
    law: Hyperelastic
    level: float
    gradient: float = 0.0
    length: float = 100.0
    domain: Literal["body"] = "body"
    effect = "stiffness_gradient"
    numbers = ("gradient", "level", "length")

    def __post_init__(self) -> None:
        """Check the length."""
        check_positive(self, "length")

    def energy_density(self, body: Body, F: Expr) -> Expr:
        """Return what is added to the energy (MPa) at a deformation gradient."""
        law = body.symbols.of(self.region, self.law)
        gradient, level, length = (body.symbols.scalar(name, value) for name, value in self.parameters.items())
        position = ufl.SpatialCoordinate(ufl.domain.extract_unique_domain(body.displacement))
        z = position[body.displacement.ufl_shape[0] - 1]
        return gradient * (z - level) / length * law.distortion_energy(F)


@dataclass(frozen=True)
class UnevenStiffness(EnergyTerm):
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

    region: str
    law: Hyperelastic
    points: tuple[tuple[float, ...], ...]
    radii: tuple[float, ...]
    domain: Literal["body"] = "body"
    effect = "uneven_stiffness"

    def __post_init__(self) -> None:
        """Check the radii."""
        check_positive(self, "radii")

    @property
    def parameters(self) -> dict[str, float]:
        """The excesses, all zero."""
        return {f"{self.name}.excess{k + 1}": 0.0 for k in range(len(self.points))}

    def energy_density(self, body: Body, F: Expr) -> Expr:
        """Return what is added to the energy (MPa) at a deformation gradient."""
        law = body.symbols.of(self.region, self.law)
        position = ufl.SpatialCoordinate(ufl.domain.extract_unique_domain(body.displacement))
        excess = 0.0
        for point, radius, (name, value) in zip(self.points, self.radii, self.parameters.items(), strict=True):
            away = position - ufl.as_vector(point)
            excess = excess + body.symbols.scalar(name, value) * _near(away, radius)
        return excess * law.distortion_energy(F)


@dataclass(frozen=True)
class StiffLump(EnergyTerm):
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

    region: str
    law: Hyperelastic
    origin: tuple[float, float]
    direction: tuple[float, float]
    excess: float = 0.0
    depth: float = 0.0
    side: float = 0.0
    radius: float = 1.0
    domain: Literal["body"] = "body"
    effect = "stiff_lump"
    numbers = ("excess", "depth", "side", "radius")

    def __post_init__(self) -> None:
        """Check the radius."""
        check_positive(self, "radius")

    def energy_density(self, body: Body, F: Expr) -> Expr:
        """Return what is added to the energy (MPa) at a deformation gradient."""
        law = body.symbols.of(self.region, self.law)
        excess, depth, side, radius = (body.symbols.scalar(name, value) for name, value in self.parameters.items())
        position = ufl.SpatialCoordinate(ufl.domain.extract_unique_domain(body.displacement))
        x, y = self.direction
        away = position - ufl.as_vector(self.origin) - depth * ufl.as_vector((x, y)) - side * ufl.as_vector((-y, x))
        return excess * _near(away, radius) * law.distortion_energy(F)


def _near(away: Expr, radius: Expr | float) -> Expr:
    # As 1 / (1 + exp), which overflows far away.
    return 0.5 * (1 - ufl.tanh(0.5 * _EDGE * (ufl.dot(away, away) / radius**2 - 1)))

"""Sizes of what labs test: specimens with what presses, pulls or draws them; checked, without a model."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from legfem.common.errors import AboveZero, Checked, InputError
from legfem.common.units import FloatArray

Faces = Literal["rough", "frictionless"]
Base = Literal["bonded", "sliding"]


@dataclass(frozen=True)
class BallOnLayer(Checked):
    """A rigid ball above a layer on a rigid base.

    Parameters
    ----------
    thickness : float
        Thickness of the layer, mm.
    ball_radius : float
        mm.
    layer_radius : float
        Radius of the layer, whose side is free (mm).
    ball : {"rough", "frictionless"}
        Whether what touches the ball sticks.
    base : {"bonded", "sliding"}
        Whether the layer sticks to its base; it doesn't lift off in either case.
    """

    thickness: AboveZero[float]
    ball_radius: AboveZero[float] = 5.0
    layer_radius: AboveZero[float] = 40.0
    ball: Faces = "rough"
    base: Base = "bonded"


@dataclass(frozen=True)
class CylinderBetweenPlates(Checked):
    """A cylinder compressed along its axis between two rigid plates.

    Parameters
    ----------
    radius, height : float
        Radius and height of the cylinder, mm.
    ends : {"bonded", "sliding"}
        Whether the end faces stick to the plates. Where the bulging side comes onto the bonded
        plates, it sticks too.
    """

    radius: AboveZero[float] = 25.0
    height: AboveZero[float] = 30.0
    ends: Literal["bonded", "sliding"] = "sliding"


@dataclass(frozen=True)
class TwistedCylinder(Checked):
    """A cylinder between two plates that stick to its ends, one of which turns about its axis.

    Parameters
    ----------
    radius, height : float
        Radius of the cylinder and distance of the plates, mm.
    """

    radius: AboveZero[float]
    height: AboveZero[float]


def check_rounding(radius: float, edge: float) -> None:
    """Check that a punch's rounded edge leaves a flat face.

    Raises
    ------
    InputError
        If it doesn't.
    """
    if edge >= radius:
        raise InputError("punch", "edge", f"a rounding of {edge:g} mm leaves no flat face", "give less than its radius")


@dataclass(frozen=True)
class PunchOnLayer(Checked):
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

    thickness: AboveZero[float]
    radius: AboveZero[float] = 5.0
    edge: AboveZero[float] = 0.5
    layer_radius: AboveZero[float] = 40.0
    punch: Faces = "rough"
    base: Base = "bonded"

    def __post_init__(self) -> None:
        """Check the sizes."""
        super().__post_init__()
        check_rounding(self.radius, self.edge)
        if self.layer_radius <= self.radius:
            problem = f"the punch of {self.radius:g} mm covers the layer"
            raise InputError("layer", "layer_radius", problem, "give more than the punch's radius")


@dataclass(frozen=True)
class CupOnLayer(Checked):
    """A suction cup on a layer on a rigid base.

    Parameters
    ----------
    thickness : float
        Thickness of the layer, mm.
    opening_radius : float
        Radius of the cup's opening, mm.
    rim_width : float
        Width of the cup's face on the skin, from the opening out (mm).
    layer_radius : float
        Radius of the layer, whose side is free (mm).
    rim : {"bonded", "sliding"}
        Whether the skin under the rim sticks; it doesn't lift off in either case.
    base : {"bonded", "sliding"}
        Whether the layer sticks to its base; it doesn't lift off in either case.
    """

    thickness: AboveZero[float]
    opening_radius: AboveZero[float] = 5.0
    rim_width: AboveZero[float] = 2.0
    layer_radius: AboveZero[float] = 40.0
    rim: Literal["bonded", "sliding"] = "bonded"
    base: Base = "bonded"

    def __post_init__(self) -> None:
        """Check the sizes."""
        super().__post_init__()
        outer = self.opening_radius + self.rim_width
        if self.layer_radius <= outer:
            problem = f"the cup of {outer:g} mm covers the layer"
            raise InputError("cup", "layer_radius", problem, "give more than the opening's radius and the rim")

    @property
    def opening(self) -> float:
        """Area of the opening (mm2): a suction of 1 MPa on it pulls with so many N."""
        return math.pi * self.opening_radius**2


@dataclass(frozen=True)
class CylinderOnBlock(Checked):
    """A rigid cylinder across a block on a rigid base.

    Parameters
    ----------
    thickness, width : float
        Sizes of the block along the travel and across the cylinder, mm.
    cylinder_radius : float
        mm.
    length : float
        Length over which cylinder and block touch, along the cylinder (mm); ends don't count.
    cylinder : {"rough", "frictionless"}
        Whether what touches the cylinder sticks.
    base : {"bonded", "sliding"}
        Whether the block sticks to its base; it doesn't lift off in either case.
    """

    thickness: AboveZero[float]
    width: AboveZero[float]
    length: AboveZero[float]
    cylinder_radius: AboveZero[float] = 15.0
    cylinder: Faces = "rough"
    base: Base = "bonded"

    def __post_init__(self) -> None:
        """Check the sizes."""
        super().__post_init__()
        if self.width < self.cylinder_radius:
            raise InputError(
                "block", "width", f"{self.width:g} mm end under the cylinder", "give more than the cylinder's radius"
            )


@dataclass(frozen=True)
class HomogeneousBody(Checked, ABC):
    """Sizes of a specimen that is strained alike everywhere.

    Parameters
    ----------
    length : float
        By which a displacement is a strain, undeformed (mm).
    area : float
        On which the force acts, undeformed (mm2).
    """

    length: AboveZero[float]
    area: AboveZero[float]

    free: ClassVar[tuple[int, ...]]
    """Axes along which nothing pulls: their stretches follow."""
    component: ClassVar[tuple[int, int]]
    """Component of the nominal stress that is recorded."""

    @property
    def sign(self) -> float:
        """Sign of the strain in which displacement and force count as positive."""
        return 1.0

    @abstractmethod
    def gradient(self, strain: Any, free: Any) -> Any:
        """Return the deformation gradient (n, 3, 3) at strains (n,), with the free axes' stretches (k, n)."""

    @abstractmethod
    def free_stretch(self, strain: Any) -> Any:
        """Return the stretch (n,) of the free axes at which nothing changes its volume."""

    def nominal_over_true(self, strain: FloatArray) -> FloatArray:
        """Return the recorded component of the nominal stress over that of the true one, (n,), at a kept volume."""
        free = np.tile(self.free_stretch(strain), (len(self.free), 1))
        column = self.component[1]
        return np.asarray(np.linalg.inv(self.gradient(strain, free))[:, column, column].real)


@dataclass(frozen=True)
class UniaxialSpecimen(HomogeneousBody):
    r"""A straight specimen, ``length`` between the grips or plates, ``area`` that of its cross-section.

    Its ends don't keep it from growing or shrinking sideways. Incompressible, neo-Hookean and pulled along its
    fibres, it has

    .. math:: P = \mu_T (\lambda - \lambda^{-2}) + \tfrac12 (E_L - 3 \mu_T) (\lambda^2 - 1) \lambda,

    and across them, at small strain, Young's modulus :math:`4 \mu_T E_L / (E_L + \mu_T)`.

    Parameters
    ----------
    direction : {"tension", "compression"}
        Displacement and force are positive that way.
    """

    direction: Literal["tension", "compression"] = "compression"

    free: ClassVar[tuple[int, ...]] = (1, 2)
    component: ClassVar[tuple[int, int]] = (0, 0)

    @property
    def sign(self) -> float:
        """Sign of the strain along the bar."""
        return 1.0 if self.direction == "tension" else -1.0

    def gradient(self, strain: Any, free: Any) -> Any:
        """Return a stretch along the first axis, and free ones across."""
        return np.stack([1 + strain, *free], axis=-1)[..., None] * np.eye(3)

    def free_stretch(self, strain: Any) -> Any:
        """Return the stretch across of an incompressible bar."""
        return (1 + strain) ** -0.5

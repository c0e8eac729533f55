"""Indenters of a leg in 3D, and their pose."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np

from legfem.common.errors import check_positive
from legfem.common.units import FloatArray
from legfem.mechanics.indenters import FiniteCylinder, RigidBall, RigidCylinder, RigidIndenter, TurnedCylinder


@dataclass(frozen=True)
class Cylinder:
    """The rigid cylinder of the tests.

    Parameters
    ----------
    radius, length : float
        mm; the length includes the rounding of the ends.
    edge_radius : float
        Radius of the rounding of the end edges (mm).
    """

    radius: float = 15.0
    length: float = 50.0
    edge_radius: float = 2.0

    def __post_init__(self) -> None:
        """Check the sizes."""
        check_positive(self, "radius", "length", "edge_radius")

    def shape(self, dimension: int) -> RigidIndenter:
        """Return the signed distance in plane strain (2) or in 3D (3)."""
        if dimension == 2:
            return RigidCylinder(self.radius)
        return FiniteCylinder(self.radius, self.length / 2, self.edge_radius)


_OUTLINE = 13
"""Points of an indenter's outline, along its axis."""


@dataclass(frozen=True)
class Punch(Cylinder):
    """A flat-ended cylinder that is pressed with its end."""


@dataclass(frozen=True)
class Ball:
    """A rigid ball.

    Parameters
    ----------
    radius : float
        Radius, mm.
    """

    radius: float = 15.0

    def __post_init__(self) -> None:
        """Check the size."""
        check_positive(self, "radius")


type Indenting = Cylinder | Punch | Ball


@dataclass(frozen=True)
class Pose:
    """Where a cylinder, a ball or a punch is pressed, square to the leg's axis.

    Parameters
    ----------
    aim : (float, float)
        A point on its line of travel (mm).
    level : float
        Level of its middle, mm.
    direction_deg : float
        Direction of its travel, degrees from +x counter-clockwise.
    axis_deg : float
        Turn of a cylinder about its travel, degrees, right-handed: 0 lies along the leg, 90
        across it.
    """

    aim: tuple[float, float]
    level: float
    direction_deg: float
    axis_deg: float = 0.0

    @property
    def direction(self) -> FloatArray:
        """Unit vector of travel, (3,)."""
        angle = math.radians(self.direction_deg)
        return np.array([math.cos(angle), math.sin(angle), 0.0])

    @property
    def frame(self) -> FloatArray:
        """Unit vectors (3, 3) along a cylinder's axis, square to axis and travel, and along the travel."""
        travel, up = self.direction, np.array([0.0, 0.0, 1.0])
        turn = math.radians(self.axis_deg)
        axis = math.cos(turn) * up + math.sin(turn) * np.cross(travel, up)
        return np.array([axis, np.cross(travel, axis), travel])


@dataclass(frozen=True)
class IndenterInPose[Kind: Indenting](ABC):
    """An indenter in its pose.

    Parameters
    ----------
    given
        Sizes of the indenter.
    pose
        Where it stands.
    """

    given: Kind
    pose: Pose

    @property
    def axis(self) -> FloatArray:
        """Unit vector of the axis of symmetry, (3,)."""
        return np.asarray(self.pose.frame[0])

    @property
    @abstractmethod
    def shape(self) -> RigidIndenter:
        """Signed distance from its surface."""

    @property
    @abstractmethod
    def reach(self) -> float:
        """Half of its extent along the leg, mm."""

    @property
    @abstractmethod
    def contact(self) -> tuple[float, float]:
        """Distance from its middle to a flat body that it touches, and half the contact line's length, mm."""

    @abstractmethod
    def ahead(self, across_travel: FloatArray) -> FloatArray:
        """Return the distance of its front surface ahead of its middle (mm), NaN beside the indenter.

        Parameters
        ----------
        across_travel : (..., 2) array
            Offsets (mm) along the first two directions of the pose's frame.
        """

    @abstractmethod
    def profile(self) -> FloatArray:
        """Return its outline: positions along the axis and the radii there, (n, 2), mm."""


class CylinderInPose(IndenterInPose[Cylinder]):
    """A cylinder that is pressed with its side."""

    @property
    def shape(self) -> RigidIndenter:
        """Signed distance from its surface."""
        if self.axis[2] == 1.0:
            return self.given.shape(3)
        return TurnedCylinder(self.given.radius, self.given.length / 2, self.given.edge_radius, *map(float, self.axis))

    @property
    def reach(self) -> float:
        """Half of its extent along the leg, mm."""
        upright = abs(float(self.axis[2]))
        lying = math.sqrt(max(1 - upright**2, 0.0))
        return self.given.length / 2 * upright + self.given.radius * lying

    @property
    def contact(self) -> tuple[float, float]:
        """Distance from its middle to a flat body that it touches, and half the contact line's length, mm."""
        return self.given.radius, self.given.length / 2

    def ahead(self, across_travel: FloatArray) -> FloatArray:
        """Return the distance of its front surface ahead of its middle (mm), NaN beside the indenter."""
        size = self.given
        past = _over(np.abs(across_travel[..., 0]), size.length / 2 - size.edge_radius)
        # Towards the ends the rounding makes it thinner.
        radius = size.radius - size.edge_radius + _root(size.edge_radius**2 - past**2)
        return _root(radius**2 - across_travel[..., 1] ** 2)

    def profile(self) -> FloatArray:
        """Return its outline: positions along the axis and the radii there, (n, 2), mm."""
        half = self.given.length / 2
        heights = np.concatenate([[-half], np.linspace(-half, half, _OUTLINE), [half]])
        radii = np.full(len(heights), self.given.radius)
        radii[[0, -1]] = 0.0
        return np.column_stack([heights, radii])


class PunchInPose(CylinderInPose):
    """A cylinder that is pressed with its end."""

    @property
    def axis(self) -> FloatArray:
        """Unit vector of the axis of symmetry, which is that of travel, (3,)."""
        return self.pose.direction

    @property
    def contact(self) -> tuple[float, float]:
        """Distance from its middle to a flat body that it touches, and half the contact line's length, mm."""
        return self.given.length / 2, 0.0

    def ahead(self, across_travel: FloatArray) -> FloatArray:
        """Return the distance of its front surface ahead of its middle (mm), NaN beside the indenter."""
        size = self.given
        past = _over(np.linalg.norm(across_travel, axis=-1), size.radius - size.edge_radius)
        return size.length / 2 - size.edge_radius + _root(size.edge_radius**2 - past**2)


class BallInPose(IndenterInPose[Ball]):
    """A ball."""

    @property
    def shape(self) -> RigidIndenter:
        """Signed distance from its surface."""
        return RigidBall(self.given.radius)

    @property
    def reach(self) -> float:
        """Half of its extent along the leg, mm."""
        return self.given.radius

    @property
    def contact(self) -> tuple[float, float]:
        """Distance from its middle to a flat body that it touches, and half the contact line's length, mm."""
        return self.given.radius, 0.0

    def ahead(self, across_travel: FloatArray) -> FloatArray:
        """Return the distance of its front surface ahead of its middle (mm), NaN beside the indenter."""
        return _root(self.given.radius**2 - np.sum(across_travel**2, axis=-1))

    def profile(self) -> FloatArray:
        """Return its outline: positions along the axis and the radii there, (n, 2), mm."""
        turn = np.linspace(-np.pi / 2, np.pi / 2, _OUTLINE)
        return self.given.radius * np.column_stack([np.sin(turn), np.cos(turn)])


def in_pose(given: Indenting, pose: Pose) -> IndenterInPose[Any]:
    """Return an indenter in a pose."""
    if isinstance(given, Ball):
        return BallInPose(given, pose)
    if isinstance(given, Punch):
        return PunchInPose(given, pose)
    return CylinderInPose(given, pose)


def _over(value: FloatArray, limit: float) -> FloatArray:
    return np.asarray(np.maximum(value - limit, 0.0))


def _root(value: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.where(value >= 0, value, np.nan)))

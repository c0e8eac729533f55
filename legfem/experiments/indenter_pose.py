"""Indenters of a leg in 3D, and their pose."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from legfem.common.errors import AboveZero, Checked
from legfem.common.units import FloatArray
from legfem.mechanics.indenters import FiniteCylinder, RigidBall, RigidCylinder, RigidIndenter


@dataclass(frozen=True)
class Pose:
    """Where an indenter is pressed, square to the leg's axis.

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


_OUTLINE = 13
"""Points of an indenter's outline, along its axis."""


class LegIndenter(Checked, ABC):
    """The sizes of a rigid indenter, and what it is in a pose."""

    radius: AboveZero[float]

    def axis(self, pose: Pose) -> FloatArray:
        """Return the unit vector of the axis of symmetry, (3,)."""
        return np.asarray(pose.frame[0])

    @abstractmethod
    def placed(self, pose: Pose) -> RigidIndenter:
        """Return the signed distance from its surface."""

    @abstractmethod
    def reach(self, pose: Pose) -> float:
        """Return half of its extent along the leg, mm."""

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


@dataclass(frozen=True)
class Cylinder(LegIndenter):
    """The rigid cylinder of the tests, pressed with its side.

    Parameters
    ----------
    radius, length : float
        mm; the length includes the rounding of the ends.
    edge_radius : float
        Radius of the rounding of the end edges (mm).
    """

    radius: AboveZero[float] = 15.0
    length: AboveZero[float] = 50.0
    edge_radius: AboveZero[float] = 2.0

    def shape(self, dimension: int) -> RigidIndenter:
        """Return the signed distance in plane strain (2), or in 3D (3) along the third axis."""
        if dimension == 2:
            return RigidCylinder(self.radius)
        return FiniteCylinder(self.radius, self.length / 2, self.edge_radius)

    def placed(self, pose: Pose) -> RigidIndenter:
        """Return the signed distance from its surface."""
        return FiniteCylinder(self.radius, self.length / 2, self.edge_radius, *map(float, self.axis(pose)))

    def reach(self, pose: Pose) -> float:
        """Return half of its extent along the leg, mm."""
        upright = abs(float(self.axis(pose)[2]))
        return self.length / 2 * upright + self.radius * math.sqrt(max(1 - upright**2, 0.0))

    @property
    def contact(self) -> tuple[float, float]:
        """Distance from its middle to a flat body that it touches, and half the contact line's length, mm."""
        return self.radius, self.length / 2

    def ahead(self, across_travel: FloatArray) -> FloatArray:
        """Return the distance of its front surface ahead of its middle (mm), NaN beside the indenter."""
        past = _over(np.abs(across_travel[..., 0]), self.length / 2 - self.edge_radius)
        # Towards the ends the rounding makes it thinner.
        radius = self.radius - self.edge_radius + _root(self.edge_radius**2 - past**2)
        return _root(radius**2 - across_travel[..., 1] ** 2)

    def profile(self) -> FloatArray:
        """Return its outline: positions along the axis and the radii there, (n, 2), mm."""
        half = self.length / 2
        heights = np.concatenate([[-half], np.linspace(-half, half, _OUTLINE), [half]])
        radii = np.full(len(heights), self.radius)
        radii[[0, -1]] = 0.0
        return np.column_stack([heights, radii])


@dataclass(frozen=True)
class Punch(Cylinder):
    """A flat-ended cylinder that is pressed with its end."""

    def axis(self, pose: Pose) -> FloatArray:
        """Return the unit vector of the axis of symmetry, which is that of travel, (3,)."""
        return pose.direction

    @property
    def contact(self) -> tuple[float, float]:
        """Distance from its middle to a flat body that it touches, and half the contact line's length, mm."""
        return self.length / 2, 0.0

    def ahead(self, across_travel: FloatArray) -> FloatArray:
        """Return the distance of its front surface ahead of its middle (mm), NaN beside the indenter."""
        past = _over(np.linalg.norm(across_travel, axis=-1), self.radius - self.edge_radius)
        return self.length / 2 - self.edge_radius + _root(self.edge_radius**2 - past**2)


@dataclass(frozen=True)
class Ball(LegIndenter):
    """A rigid ball.

    Parameters
    ----------
    radius : float
        Radius, mm.
    """

    radius: AboveZero[float] = 15.0

    def placed(self, pose: Pose) -> RigidIndenter:
        """Return the signed distance from its surface."""
        return RigidBall(self.radius)

    def reach(self, pose: Pose) -> float:
        """Return half of its extent along the leg, mm."""
        return self.radius

    @property
    def contact(self) -> tuple[float, float]:
        """Distance from its middle to a flat body that it touches, and half the contact line's length, mm."""
        return self.radius, 0.0

    def ahead(self, across_travel: FloatArray) -> FloatArray:
        """Return the distance of its front surface ahead of its middle (mm), NaN beside the indenter."""
        return _root(self.radius**2 - np.sum(across_travel**2, axis=-1))

    def profile(self) -> FloatArray:
        """Return its outline: positions along the axis and the radii there, (n, 2), mm."""
        turn = np.linspace(-np.pi / 2, np.pi / 2, _OUTLINE)
        return self.radius * np.column_stack([np.sin(turn), np.cos(turn)])


def _over(value: FloatArray, limit: float) -> FloatArray:
    return np.asarray(np.maximum(value - limit, 0.0))


def _root(value: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.where(value >= 0, value, np.nan)))

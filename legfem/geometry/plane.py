"""Planes that cut a leg, with coordinates of their own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from legfem.common.errors import InputError
from legfem.common.units import FloatArray, frozen_array

_ACROSS = np.cos(np.deg2rad(45.0))
_SQUARE = np.sin(np.deg2rad(10.0))
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class CuttingPlane:
    """A plane across a leg.

    Its coordinates are lengths along `axes`: across a leg along z they are x and y.

    Parameters
    ----------
    point : (3,) array
        On the plane, mm.
    normal : (3,) array
        Of any length; upwards (towards +z).
    """

    point: FloatArray
    normal: FloatArray

    def __post_init__(self) -> None:
        """Copy, and give the normal its length and direction."""
        normal = np.asarray(self.normal, dtype=np.float64)
        unit = normal / np.linalg.norm(normal)
        object.__setattr__(self, "normal", frozen_array(unit if unit[2] >= 0 else -unit))
        object.__setattr__(self, "point", frozen_array(self.point))

    @staticmethod
    def at_level(level: float) -> CuttingPlane:
        """Return the plane z = level (mm)."""
        return CuttingPlane(level * _UP, _UP)

    @staticmethod
    def of_cylinder(position: FloatArray, direction: FloatArray, axis: FloatArray | None, source: str) -> CuttingPlane:
        """Return the plane in which a cylinder travels: through its position, across its axis.

        Parameters
        ----------
        position : (3,) array
            On the line of travel, mm.
        direction : (3,) array
            Of travel.
        axis : (3,) array, optional
            Of the cylinder; without it the plane holds the horizontal that is square to the travel.
        source : str
            What errors name as the file.

        Raises
        ------
        InputError
            If the plane doesn't lie across the leg.
        """
        travel = direction / np.linalg.norm(direction)
        along = _UP if axis is None else axis / np.linalg.norm(axis)
        normal = along - (along @ travel) * travel
        length = float(np.linalg.norm(normal))
        if length < 1e-6 or abs(normal[2]) / length < _ACROSS:
            raise InputError(
                source,
                "indenter.direction",
                "the plane of travel doesn't lie across the leg (z)",
                "give the direction of travel, and the cylinder's axis along the leg",
            )
        return CuttingPlane(position, normal)

    @property
    def axes(self) -> FloatArray:
        """Two unit vectors in the plane, (2, 3): the first is x laid into it."""
        first = np.array([1.0, 0.0, 0.0]) - self.normal[0] * self.normal
        first /= np.linalg.norm(first)
        return np.stack([first, np.cross(self.normal, first)])

    @property
    def is_level(self) -> bool:
        """Whether it lies square to z."""
        return bool(self.normal[2] > 1 - 1e-12)

    def height(self, points: FloatArray) -> FloatArray:
        """Return the distances of points (..., 3) above the plane, mm."""
        above: FloatArray = (points - self.point) @ self.normal
        return above

    def flat(self, points: FloatArray) -> FloatArray:
        """Return the coordinates (..., 2) of points (..., 3) in the plane, mm."""
        within: FloatArray = points @ self.axes.T
        return within

    def levels(self, low: FloatArray, high: FloatArray) -> tuple[float, float]:
        """Return the lowest and highest z of the plane over a rectangle of x and y, mm."""
        corners = np.array([[x, y, 0.0] for x in (low[0], high[0]) for y in (low[1], high[1])])
        z = -self.height(corners) / self.normal[2]
        return float(z.min()), float(z.max())

    def __str__(self) -> str:
        """Say where it lies."""
        x, y, z = self.point
        if self.is_level:
            return f"level {z:g} mm"
        tilt = float(np.degrees(np.arccos(self.normal[2])))
        return f"plane through ({x:.1f}, {y:.1f}, {z:.1f}) mm, tilted by {tilt:.1f} degrees"


def turn_about_travel(direction: FloatArray, axis: FloatArray, source: str) -> float:
    """Return by how much a cylinder is turned about its travel, from standing as upright as it can.

    Parameters
    ----------
    direction : (3,) array
        Of travel.
    axis : (3,) array
        Of the cylinder.
    source : str
        What errors name as the file.

    Returns
    -------
    float
        Degrees, right-handed, from -90 to 90.

    Raises
    ------
    InputError
        If the axis isn't square to the travel.
    """
    travel, along = direction / np.linalg.norm(direction), axis / np.linalg.norm(axis)
    if abs(along @ travel) > _SQUARE:
        angle = np.degrees(np.arccos(np.clip(along @ travel, -1, 1)))
        raise InputError(
            source,
            "indenter.axis",
            f"stands at {angle:.0f} degrees to the direction",
            "a cylinder travels square to its axis: correct axis or direction",
        )
    upright = _UP - (_UP @ travel) * travel
    turn = float(np.degrees(np.arctan2(along @ np.cross(travel, upright), along @ upright)))
    return (turn + 90.0) % 180.0 - 90.0

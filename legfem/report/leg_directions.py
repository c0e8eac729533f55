"""Directions round a leg in words.

Coordinates are those of DICOM: x to the patient's left, y to the back. Angles go round the leg from
the front (0 degrees) by the patient's left (90), as one who faces the patient sees it unrolled.
The fibula, where it is named beside the tibia, is on the lateral side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import LegShape


@dataclass(frozen=True)
class Directions:
    """Names of the four sides: at 0, 90, 180 and 270 degrees from the front."""

    names: tuple[str, str, str, str]

    @classmethod
    def of(cls, shape: LegShape) -> Directions:
        """Return the names, as far as the leg's parts tell."""
        sides = ("left", "right")
        if {"tibia", "fibula"} <= set(shape.bones):
            apart = shape.contours["fibula"].mean(axis=(0, 1)) - shape.contours["tibia"].mean(axis=(0, 1))
            sides = ("lateral", "medial") if apart[0] > 0 else ("medial", "lateral")
        return cls(("anterior", sides[0], "posterior", sides[1]))

    def at(self, angle: float) -> str:
        """Return a direction in words, of an angle in degrees: to the nearest 45."""
        number = round(angle / 45) % 8
        first, second = self.names[(number // 2) % 4], self.names[(number // 2 + 1) % 4]
        if number % 2 == 0:
            return first
        return "-".join(sorted((first, second), key=lambda name: name in self.names[1::2]))

    def sides(self) -> tuple[list[float], list[str]]:
        """Return angles from -180 to 180 degrees and their names, for an axis."""
        angles = [-180.0, -90.0, 0.0, 90.0, 180.0]
        return angles, [self.at(angle) for angle in angles]


def angle_round(points: FloatArray, centre: FloatArray) -> FloatArray:
    """Return the angle round the leg from the front (degrees, -180 to 180) of points (..., 2)."""
    x, y = np.moveaxis(points - centre, -1, 0)
    return np.asarray(np.degrees(np.arctan2(x, -y)))


def unwrapped(points: FloatArray) -> FloatArray:
    """Return the angles of closed contours' points (n, m, 2) about their middles, increasing."""
    centre = points.mean(axis=1, keepdims=True)
    return np.asarray(np.unwrap(angle_round(points, centre), axis=1, period=360.0))

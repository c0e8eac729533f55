"""What is measured on a leg's shape, level by level: perimeter, curvature, thickness of the fat."""

from __future__ import annotations

import numpy as np
import shapely

from legfem.common.units import FloatArray
from legfem.geometry.curve import closed_lengths
from legfem.geometry.leg_shape import HULL, SKIN, LegShape


def perimeter(shape: LegShape, part: str = SKIN) -> FloatArray:
    """Return the perimeter of a part at every level, (n_levels,), mm."""
    return closed_lengths(shape.contours[part])


def largest_girth(shape: LegShape) -> float:
    """Return the level at which the skin's perimeter is largest, mm."""
    return float(shape.levels[int(np.argmax(perimeter(shape)))])


def horizontal_curvature(shape: LegShape, part: str = SKIN) -> FloatArray:
    """Return the curvature of a part's contours in their own planes.

    By central differences of fourth order over five points: smooth noisy contours before.

    Returns
    -------
    ndarray
        (n_levels, n_points), 1/mm; positive where the contour is convex.
    """
    xy = shape.contours[part]
    one, two = ((np.roll(xy, -k, axis=1), np.roll(xy, k, axis=1)) for k in (1, 2))  # after and before
    first = (8 * (one[0] - one[1]) - (two[0] - two[1])) / 12
    second = (16 * (one[0] + one[1]) - (two[0] + two[1]) - 30 * xy) / 12
    turning = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    curvature: FloatArray = turning / np.linalg.norm(first, axis=2) ** 3
    return curvature


def fat_thickness_around(shape: LegShape) -> FloatArray:
    """Return the shortest distance to the hull, in its plane, of every point of the skin.

    Returns
    -------
    ndarray
        (n_levels, n_points of the skin), mm.
    """
    thickness = [
        shapely.distance(shapely.points(skin), shapely.LinearRing(hull))
        for skin, hull in zip(shape.contours[SKIN], shape.contours[HULL], strict=True)
    ]
    return np.stack(thickness)

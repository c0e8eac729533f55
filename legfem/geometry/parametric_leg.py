"""Leg shapes made of a few numbers."""

from __future__ import annotations

import numpy as np

from legfem.geometry.leg_shape import HULL, SKIN, LegShape, shape_of_contours
from legfem.units import FloatArray


def round_leg(
    radius: float = 57.0,
    hull_radius: float = 51.0,
    core_radius: float = 15.0,
    length: float = 60.0,
    n_levels: int = 13,
    n_points: int = 180,
) -> LegShape:
    """Return a thick-walled cylinder about a round core, the bone ``core``; mm, z from 0."""
    levels = np.linspace(0.0, length, n_levels)
    radii = {SKIN: radius, HULL: hull_radius, "core": core_radius}
    return shape_of_contours(
        levels, {part: [_circle(r)] * n_levels for part, r in radii.items()}, n_points
    )


def _circle(radius: float, points: int = 720) -> FloatArray:
    angle = 2 * np.pi * np.arange(points) / points
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])

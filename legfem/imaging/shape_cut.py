"""Cutting a leg's shape with a plane."""

from __future__ import annotations

import numpy as np
from shapely import Polygon

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.geometry.contour_table import MUSCLE_HULL
from legfem.geometry.cross_sections import SURFACES
from legfem.geometry.leg_shape import HULL, LegShape
from legfem.geometry.plane import CuttingPlane

_STEP = 0.25  # mm along the leg


def outlines_of_shape(shape: LegShape, plane: CuttingPlane, source: str) -> dict[str, Polygon]:
    """Return the outlines of skin, muscles' hull, tibia and fibula where a plane cuts a shape.

    Raises
    ------
    InputError
        If a part is missing, or ends before the plane has cut it.
    """
    outlines = {}
    for part in SURFACES:
        name = HULL if part == MUSCLE_HULL else part
        if name not in shape.contours:
            raise InputError(
                source,
                part,
                f"missing at {plane}",
                "label tibia and fibula apart from each other, or cut the leg elsewhere",
            )
        outlines[part] = Polygon(_contour(shape, name, plane, source))
    return outlines


def _contour(shape: LegShape, part: str, plane: CuttingPlane, source: str) -> FloatArray:
    """Return where the lines along the leg through a part's points meet a plane, (n, 2), mm."""
    z = np.linspace(shape.levels[0], shape.levels[-1], 2 + int(shape.length / _STEP))
    points = shape.at_levels(z).points(part)
    above = plane.height(points)
    above[np.abs(above) < 1e-9] = 0.0
    passes = (above[:-1] <= 0) & (above[1:] >= 0)
    if not passes.any(axis=0).all():
        raise InputError(
            source,
            part,
            f"{plane} leaves the scan, {z[0]:.4g} to {z[-1]:.4g} mm",
            "choose a level or a position within it",
        )
    at, along = np.argmax(passes, axis=0), np.arange(points.shape[1])
    low, high = above[at, along], above[at + 1, along]
    share = (-low / np.where(high > low, high - low, 1.0))[:, None]
    return plane.flat((1 - share) * points[at, along] + share * points[at + 1, along])

"""A leg's shape from outlines that don't keep clear of each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from shapely import Polygon

from legfem.common.units import FloatArray
from legfem.geometry.contour_table import MUSCLE_HULL
from legfem.geometry.cross_sections import Clearances, nested_outlines
from legfem.geometry.leg_shape import HULL, LegShape, shape_of_contours
from legfem.geometry.shape_checks import check_shape
from legfem.geometry.shape_smoothing import smoothed

_MESHED_CLEARANCE = 0.5
_AROUND, _ALONG = 10.0, 12.0
"""Wavelengths (mm) below which undulations are smoothed away."""


def shape_of_outlines(levels: ArrayLike, outlines: Sequence[Mapping[str, Polygon]], n_points: int = 180) -> LegShape:
    """Return the shape of outlines as they are; ``muscle_hull`` becomes the hull."""
    contours: dict[str, list[FloatArray]] = {}
    for here in outlines:
        for part, polygon in here.items():
            name = HULL if part == MUSCLE_HULL else part
            contours.setdefault(name, []).append(np.asarray(polygon.exterior.coords)[:-1])
    return shape_of_contours(levels, contours, n_points)


def nested_shape(
    levels: ArrayLike,
    outlines: Sequence[Mapping[str, Polygon]],
    source: str | Path,
    clearances: Clearances | None = None,
) -> LegShape:
    """Make a shape whose parts nest with clearances.

    The hull of the muscles is joined with the bones and their clearance, its furrows bridged, kept
    off the skin; a bone that stands too close to the skin is cut back there
    (see `legfem.geometry.cross_sections.nested_outlines`).

    Parameters
    ----------
    levels : (n,) array
        Evenly spaced z, mm.
    outlines : sequence of mapping
        At each level ``skin``, ``muscle_hull`` and the bones, mm.
    source : str or Path
        What errors name as the file.
    clearances : Clearances, optional
        Room to keep between the parts.

    Raises
    ------
    InputError
        If the parts do not nest, or the coordinates are not mm.
    """
    room, z = clearances or Clearances(), np.asarray(levels, dtype=np.float64)
    nested = [
        nested_outlines(here, 0.0, f"{source}, level {level:g} mm", room)
        for level, here in zip(z, outlines, strict=True)
    ]
    shape = smoothed(shape_of_outlines(z, nested), _AROUND, _ALONG)
    check_shape(shape, source, _MESHED_CLEARANCE)
    return shape

"""A leg's shape from closed surfaces (STL and what else trimesh reads) of its parts."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import trimesh
from numpy.typing import ArrayLike
from shapely import Polygon

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.geometry.contours import check_girth
from legfem.geometry.cross_sections import Clearances, largest_polygon, nested_outlines
from legfem.geometry.leg_shape import HULL, SKIN, LegShape, shape_of_contours
from legfem.geometry.shape_checks import check_shape
from legfem.geometry.shape_smoothing import smoothed

MUSCLE_HULL = "muscle_hull"
MESHED_CLEARANCE = 0.5


def read_surface(path: Path) -> Any:
    """Read a closed surface (`trimesh.Trimesh`, mm).

    Raises
    ------
    InputError
        If the file can't be read, or the surface has holes.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "file", "not found", "check the path")
    try:
        surface = trimesh.load(path, force="mesh")
    except Exception as error:  # trimesh's readers raise all kinds
        raise InputError(
            path, "file", f"is no surface that can be read ({error})", "save it as STL"
        ) from None
    if len(surface.faces) == 0:
        raise InputError(path, "file", "holds no triangles", "save it as STL, PLY or OBJ")
    if not surface.is_watertight:
        edges, count = np.unique(surface.edges_sorted, axis=0, return_counts=True)
        free = edges[count == 1]
        near = surface.vertices[free[0]].mean(axis=0) if len(free) else surface.centroid
        at = ", ".join(f"{c:.1f}" for c in near)
        raise InputError(
            path, "surface", f"has holes: {len(free)} free edges, one near ({at})",
            "close it in the program that made it",
        )  # fmt: skip
    return surface


def outlines_of_surface(surface: Any, levels: ArrayLike, source: str | Path) -> list[Polygon]:
    """Return the largest outline of a surface at every level z (mm).

    Raises
    ------
    InputError
        If a level doesn't meet the surface.
    """
    outlines = []
    for level in np.asarray(levels, dtype=np.float64):
        segments = trimesh.intersections.mesh_plane(surface, [0.0, 0.0, 1.0], [0.0, 0.0, level])
        # The two triangles at an edge find the same point but for rounding.
        lines = shapely.linestrings(np.round(segments[..., :2], 6)) if len(segments) else []
        faces = shapely.polygonize(list(lines))
        if shapely.is_empty(faces):
            low, high = surface.bounds[:, 2]
            raise InputError(
                source, f"level {level:g} mm", "no closed outline there",
                f"choose levels between {low:.1f} and {high:.1f} mm",
            )  # fmt: skip
        outlines.append(largest_polygon(shapely.union_all(faces), source, "outline"))
    return outlines


def shape_of_surfaces(
    paths: Mapping[str, Path],
    levels: ArrayLike,
    clearances: Clearances | None = None,
    n_points: int = 180,
    around: float = 10.0,
    along: float = 12.0,
) -> LegShape:
    """Make a leg's shape of the closed surfaces of its parts.

    The hull of the muscles is joined with the bones and their clearance, its furrows bridged, kept
    off the skin; a bone that stands too close to the skin is cut back there
    (see `legfem.geometry.cross_sections.nested_outlines`).

    Parameters
    ----------
    paths : mapping of Path
        ``skin``, ``muscle_hull`` and the bones by any names to their files; coordinates in mm, z
        along the leg.
    levels : (n,) array
        Evenly spaced z, mm.
    clearances : Clearances, optional
        Room to keep between the parts.
    n_points : int
        Points a contour.
    around, along : float
        Wavelengths (mm) below which undulations are smoothed away.

    Raises
    ------
    InputError
        If a file is missing or its surface has holes, a level doesn't meet a surface, the
        coordinates are not mm, or the parts do not nest.
    """
    for part in (SKIN, MUSCLE_HULL):
        if part not in paths:
            raise InputError("surfaces", part, "the part is missing", "give its file")
    room = clearances or Clearances()
    z = np.asarray(levels, dtype=np.float64)
    skin = read_surface(paths[SKIN])
    # Before anything else: levels in mm don't meet a leg in metres.
    _check_units(skin, paths[SKIN])
    outlines = {SKIN: outlines_of_surface(skin, z, paths[SKIN])}
    for part in paths:
        if part != SKIN:
            outlines[part] = outlines_of_surface(read_surface(paths[part]), z, paths[part])
    contours: dict[str, list[FloatArray]] = {}
    for k, level in enumerate(z):
        here = {part: loops[k] for part, loops in outlines.items()}
        nested = nested_outlines(here, 0.0, f"level {level:g} mm", room)
        for part, polygon in nested.items():
            name = HULL if part == MUSCLE_HULL else part
            contours.setdefault(name, []).append(np.asarray(polygon.exterior.coords)[:-1])
    shape = smoothed(shape_of_contours(z, contours, n_points), around, along)
    check_shape(shape, paths[SKIN], MESHED_CLEARANCE)
    return shape


def _check_units(skin: Any, path: Path) -> None:
    """Check the girth at the middle of the skin's height."""
    middle = float(skin.bounds[:, 2].mean())
    outline = outlines_of_surface(skin, [middle], path)[0]
    check_girth(float(outline.length), path)

"""Reading and writing a leg's shape: ``level_mm,part,i,x_mm,y_mm``.

Cross-sections of surfaces (see `legfem.geometry.contour_table`) are read too: what they call
``muscle_hull`` is given room.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from legfem.common.errors import InputError
from legfem.geometry.contour_table import MUSCLE_HULL, read_loops
from legfem.geometry.cross_sections import polygons_of
from legfem.geometry.leg_shape import HULL, SKIN, LegShape, shape_of_contours
from legfem.geometry.nested_shape import nested_shape
from legfem.geometry.shape_checks import check_shape

HEADER = ("level_mm", "part", "i", "x_mm", "y_mm")


def write_shape(shape: LegShape, path: Path) -> None:
    """Write a shape, to 0.1 micrometre."""
    rows = [",".join(HEADER)]
    rows += [
        f"{level:.4f},{part},{i},{x:.4f},{y:.4f}"
        for part in shape.parts
        for level, loop in zip(shape.levels, shape.contours[part], strict=True)
        for i, (x, y) in enumerate(loop)
    ]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def read_shape(path: Path, between: tuple[float, float] = (-np.inf, np.inf)) -> LegShape:
    """Read a shape and check that its parts nest.

    The contours may have different numbers of points from level to level, and start anywhere.

    Parameters
    ----------
    path : Path
        The file.
    between : tuple of float
        Levels (mm) beyond which rows are passed over.

    Raises
    ------
    InputError
        If the table can't be read, a part is missing or missing at a level, or the contours are
        not those of a leg (see `legfem.geometry.shape_checks.check_shape`).
    """
    path = Path(path)
    levels, found = read_loops(path, between)
    if any(MUSCLE_HULL in here for here in found):
        names = [f"level {level:g} mm" for level in levels]
        outlines = [polygons_of(here, path, at) for here, at in zip(found, names, strict=True)]
        try:
            return nested_shape(levels, outlines, path)
        except ValueError as error:
            raise not_closed(path, error) from None
    contours, points = {}, {}
    for part in dict.fromkeys(part for here in found for part in here):
        loops = [max(here.get(part, [np.empty((0, 2))]), key=len) for here in found]
        for level, loop in zip(levels, loops, strict=True):
            if len(loop) < 8:
                raise InputError(
                    path,
                    f"{part}, level {level:g} mm",
                    f"{len(loop)} points are too few",
                    "give the contour of every part at every level, 8 points or more",
                )
        contours[part] = loops
        points[part] = max(len(loop) for loop in loops)
    for part in (SKIN, HULL):
        if part not in contours:
            raise InputError(path, part, "the part is missing", f"add rows 'level,{part},i,x,y'")
    try:
        shape = shape_of_contours(levels, contours, points)
    except ValueError as error:
        raise not_closed(path, error) from None
    check_shape(shape, path)
    return shape


def not_closed(path: Path, error: ValueError) -> InputError:
    """Return the error of a file with a contour that no closed curve goes through."""
    return InputError(
        path, "x_mm, y_mm", f"a contour is no closed outline: {error}", "give its points in order around it, once"
    )

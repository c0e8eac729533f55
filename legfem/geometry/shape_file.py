"""Reading and writing a leg's shape: ``level_mm,part,i,x_mm,y_mm``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from legfem.common.errors import InputError
from legfem.common.tables import read_table
from legfem.geometry.leg_shape import HULL, SKIN, LegShape, shape_of_contours
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
    table = read_table(path, HEADER, text=("part",))
    inside = table["level_mm"].between(*between)
    table = table[inside] if inside.any() else table
    levels = np.unique(table["level_mm"].to_numpy())
    contours, points = {}, {}
    for part, rows in table.groupby("part", sort=False):
        loops = {
            level: loop.sort_values("i")[["x_mm", "y_mm"]].to_numpy(np.float64)
            for level, loop in rows.groupby("level_mm")
        }
        for level in levels:
            if len(loops.get(level, ())) < 8:
                raise InputError(
                    path, f"{part}, level {level:g} mm",
                    f"{len(loops.get(level, ()))} points are too few",
                    "give the contour of every part at every level, 8 points or more",
                )  # fmt: skip
        contours[str(part)] = [loops[level] for level in levels]
        points[str(part)] = max(len(loop) for loop in loops.values())
    for part in (SKIN, HULL):
        if part not in contours:
            raise InputError(path, part, "the part is missing", f"add rows 'level,{part},i,x,y'")
    shape = shape_of_contours(levels, contours, points)
    check_shape(shape, path)
    return shape

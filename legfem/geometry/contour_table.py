"""Contours of a leg at several levels: ``level_mm,part,loop,i,x_mm,y_mm``, for both papers.

``loop`` numbers the outlines that a part has at a level (muscles apart from each other), and may be
absent where every part has one.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from shapely import Polygon

from legfem.common.errors import InputError
from legfem.common.input_files import read_table
from legfem.common.units import FloatArray

HEADER = ("level_mm", "part", "loop", "i", "x_mm", "y_mm")
_LONGEST_MM = 1200.0
MUSCLE_HULL = "muscle_hull"
"""Muscles as they were segmented: bones may stick out, and nothing is known of their room."""

type Loops = dict[str, list[FloatArray]]


def read_loops(path: Path, between: tuple[float, float] = (-np.inf, np.inf)) -> tuple[FloatArray, list[Loops]]:
    """Read the outlines of every part at every level.

    Parameters
    ----------
    path : Path
        The file.
    between : tuple of float
        Levels (mm) beyond which rows are passed over, unless none are left.

    Returns
    -------
    levels : (n,) array
        Increasing, mm.
    loops : list of dict
        At each level part to its outlines, (m, 2) each, mm.

    Raises
    ------
    InputError
        If the table can't be read, or its levels are no leg's in mm.
    """
    table = read_table(Path(path), HEADER, text=("part",), optional=("loop",))
    inside = table["level_mm"].between(*between)
    table = table[inside] if inside.any() else table
    if "loop" not in table:
        table = table.assign(loop=0.0)
    levels = np.unique(table["level_mm"].to_numpy(np.float64))
    check_levels(levels, path)
    found: dict[float, Loops] = {float(level): {} for level in levels}
    for (level, part, _), rows in table.groupby(["level_mm", "part", "loop"], sort=False):
        points = rows.sort_values("i")[["x_mm", "y_mm"]].to_numpy(np.float64)
        found[level].setdefault(str(part), []).append(points)
    return levels, [found[float(level)] for level in levels]


def check_levels(levels: FloatArray, source: str | Path) -> None:
    """Check that levels (n,) may be a leg's in mm.

    Raises
    ------
    InputError
        If they span more.
    """
    if (span := float(np.ptp(levels))) > _LONGEST_MM:
        raise InputError(source, "level_mm", f"the levels span {span:.4g} mm, more than a leg", "give levels in mm")


def write_outlines(outlines: Mapping[float, Mapping[str, Polygon]], path: Path) -> None:
    """Write the outlines of parts at levels (mm), to 0.1 micrometre."""
    rows = [",".join(HEADER)]
    rows += [
        f"{level:g},{part},0,{i},{x:.4f},{y:.4f}"
        for level, here in outlines.items()
        for part, outline in here.items()
        for i, (x, y) in enumerate(np.asarray(outline.exterior.coords)[:-1])
    ]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")

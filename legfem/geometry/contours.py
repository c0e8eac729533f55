"""Files of contours: of one section (``part,x_mm,y_mm``), and of a leg at levels.

The latter are ``level_mm,part,loop,i,x_mm,y_mm``.
``loop`` numbers the outlines that a part has at a level (muscles apart from each other), and may be
absent where every part has one.
"""

import difflib
import re
from collections.abc import Mapping
from functools import partial
from itertools import chain, combinations
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from shapely import Polygon
from shapely.validation import explain_validity

from legfem.common.errors import InputError
from legfem.common.input_files import read_table
from legfem.common.units import FloatArray
from legfem.geometry.section import LAYERS, LIMBS, MUSCLE, LegSection, minimal_fat_thickness

if TYPE_CHECKING:
    import pandas as pd

_PLACE = re.compile(r"\[(\S+) (\S+)\]")
"""In what Shapely says of a polygon."""

LEVELS_HEADER = ("level_mm", "part", "loop", "i", "x_mm", "y_mm")
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
    table = _with_parts(read_table(Path(path), LEVELS_HEADER, text=("part",), optional=("loop",)))
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
    rows = [",".join(LEVELS_HEADER)]
    rows += [
        f"{level:g},{part},0,{i},{x:.4f},{y:.4f}"
        for level, here in outlines.items()
        for part, outline in here.items()
        for i, (x, y) in enumerate(np.asarray(outline.exterior.coords)[:-1])
    ]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def _with_parts(table: "pd.DataFrame") -> "pd.DataFrame":
    """Return a table with its parts' names as they are known: whoever writes ``Skin`` means the skin."""
    return table.assign(part=table["part"].str.lower())


SECTION_HEADER = ("part", "x_mm", "y_mm")
MINIMAL_POINTS = 8
MOST_POINTS = 5000
GIRTH_RANGE_MM = (100.0, 800.0)
# A closed contour's end stands about one spacing from its start.
OPEN_GAP_IN_SPACINGS = 5.0


def read_contours(path: Path, fascia_thickness: float, regions: Mapping[str, str] | None = None) -> LegSection:
    """Read a leg section and check that it is one.

    Parameters
    ----------
    path : Path
        CSV file with the header ``part,x_mm,y_mm``; each part's points in order around it.
    fascia_thickness : float
        Thickness of the fascia, mm; its layer lies inwards of the ``fascia`` contour, which a limb without it hasn't.
    regions : mapping of str to str
        Kind of each outline that isn't one of the layers or of the usual bones, by its name.

    Raises
    ------
    InputError
        If the table can't be read (see `legfem.common.input_files.read_table`) or the contours aren't
        those of a leg (see `check_section`).
    """
    path = Path(path)
    table = _with_parts(read_table(path, LEVELS_HEADER, text=("part",), optional=("level_mm", "loop", "i")))
    if "level_mm" in table:
        problem = "these are contours at several levels"
        raise InputError(path, "level_mm", problem, "choose one: level_mm under [section] of subject.toml")
    given, layers = tuple(map(str.lower, regions or ())), LAYERS if fascia_thickness else LAYERS[:1]
    known = tuple(dict.fromkeys((*layers, *chain(*LIMBS.values()), *given)))
    for line, part in table["part"].items():
        if part not in known:
            near = difflib.get_close_matches(part, known, n=1)
            said = f'say what it is in subject.toml: [regions.{part}], kind = "bone" or "muscle"'
            hint = f"did you mean '{near[0]}'?" if near else said
            raise InputError(path, f"part, line {line}", f"unknown part '{part}'", hint)
    there = {*layers, *table["part"], *given}
    contours: dict[str, FloatArray] = {}
    for part in (part for part in known if part in there):
        rows = table[table["part"] == part]
        contours[part] = rows[["x_mm", "y_mm"]].to_numpy(dtype=np.float64)
        _check_contour(path, part, contours[part])
        # Points closer than any mesh's only cost time.
        contours[part] = contours[part][:: 1 + len(contours[part]) // MOST_POINTS]
    muscles = [name.lower() for name, kind in (regions or {}).items() if kind == "muscle"]
    section = LegSection.of_parts(contours, fascia_thickness, muscles)
    check_section(section, path)
    return section


def write_contours(section: LegSection, path: Path) -> None:
    """Write a section as ``contours.csv``, to 0.1 micrometre."""
    rows = [",".join(SECTION_HEADER)]
    rows += [f"{part},{x:.4f},{y:.4f}" for part in section.parts for x, y in section.contour(part)]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def check_section(section: LegSection, source: str | Path) -> None:
    """Check that contours make a leg.

    Parameters
    ----------
    section : LegSection
        The leg.
    source : str or Path
        What errors name as the file.

    Raises
    ------
    InputError
        If a contour crosses itself or another, the girth is not a leg's in mm, the bones are
        not inside the fascia or the fascia not inside the skin, the fascia is thicker than
        the fat or meets the bones, or a muscle leaves the fascia or overlaps a bone or another.
    """
    for part in section.parts:
        if (points := len(section.contour(part))) < MINIMAL_POINTS:
            problem = f"only {points} of its points lie apart"
            raise InputError(source, part, problem, f"give at least {MINIMAL_POINTS} around the part")
    polygons = {part: section.polygon(part) for part in section.parts}
    hull = "skin" if MUSCLE in section.lacks else "fascia"
    check_nested({part: one for part, one in polygons.items() if part not in section.muscles}, hull, source)
    _check_muscles(section, polygons, source)
    if hull == "fascia":
        _check_fascia(section, polygons, source)


def _check_contour(path: Path, part: str, points: FloatArray) -> None:
    refused = partial(InputError, path, part)
    if len(points) == 0:
        without = "; fascia_thickness_mm = 0 under [section] says that there is no muscle" if part == "fascia" else ""
        raise refused("the part is missing", f"add rows '{part},x,y' around it{without}")
    if len(points) < MINIMAL_POINTS:
        raise refused(f"{len(points)} points are too few", f"give at least {MINIMAL_POINTS} around the part")
    spacing = np.linalg.norm(np.diff(points, axis=0), axis=1)
    gap = float(np.linalg.norm(points[-1] - points[0]))
    # The largest spacing counts too: contours drawn by hand are sparse where they are straight.
    if gap > max(OPEN_GAP_IN_SPACINGS * float(np.median(spacing)), 1.5 * float(spacing.max())):
        apart = f"points are {np.median(spacing):.1f} mm apart"
        problem = f"the contour is open ({gap:.1f} mm from its last point to its first, {apart})"
        raise refused(problem, "add the missing points; the last must stand next to the first")


def check_girth(around: float, source: str | Path) -> None:
    """Check that a skin's perimeter is a leg's in mm.

    Raises
    ------
    InputError
        If it isn't; the line names the unit that the coordinates look like.
    """
    low, high = GIRTH_RANGE_MM
    if low <= around <= high:
        return
    for unit, factor in (("centimetres", 10.0), ("metres", 1000.0), ("micrometres", 1e-3)):
        if low <= around * factor <= high:
            problem = f"the skin's girth is {around:.4g} mm, so these look like {unit}"
            raise InputError(source, "x_mm, y_mm", problem, f"multiply the coordinates by {factor:g}")
    problem = f"a girth of {around:.4g} mm is not a leg's"
    raise InputError(source, "skin", problem, f"give coordinates in mm ({low:g}-{high:g} mm around)")


def _check_valid(polygon: Polygon, part: str, source: str | Path) -> None:
    if not polygon.is_valid:
        place = _PLACE.search(explain_validity(polygon))
        near = f" near ({float(place[1]):.1f}, {float(place[2]):.1f}) mm" if place else ""
        problem, remedy = f"the contour crosses itself{near}", "give its points in order around it, once"
        raise InputError(source, part, problem, remedy)


_LAPS = 0.02
"""Share of a muscle's area that two who draw one border don't agree on; the muscle named first has it."""


def _check_muscles(section: LegSection, polygons: Mapping[str, Polygon], source: str | Path) -> None:
    for number, muscle in enumerate(section.muscles):
        own = polygons[muscle]
        _check_valid(own, muscle, source)
        beside = (bone for bone in section.bones if not own.contains_properly(polygons[bone]))
        others = (*beside, *list(section.muscles)[:number])
        laps = {f"overlaps the {other}": own.intersection(polygons[other]).area for other in others}
        for what, area in {"leaves the fascia": own.difference(polygons["fascia"]).area, **laps}.items():
            if area > _LAPS * own.area:
                remedy = "draw the border that both share once, for both"
                raise InputError(source, muscle, f"{what}: {area:.2g} mm² of it", remedy)


def check_nested(
    parts: Mapping[str, Polygon],
    hull: str,
    source: str | Path,
    where: str = "",
    clearance: float = 0.0,
    leg_sized: bool = True,
) -> None:
    """Check that a section's parts lie within each other.

    Parameters
    ----------
    parts : mapping
        Outlines (mm) of the skin, the hull and the bones.
    hull : str
        Name of the part between skin and bones.
    source, where
        What errors name as the file, and after the part.
    clearance : float
        Least distance that is wanted between the parts (mm).
    leg_sized : bool
        Whether the girth has to be a leg's.

    Raises
    ------
    InputError
        If an outline crosses itself, a part isn't inside the one around it with the clearance, or the girth is not a
        leg's in mm.
    """
    for part, polygon in parts.items():
        _check_valid(polygon, f"{part}{where}", source)
    if leg_sized:
        check_girth(float(parts["skin"].length), source)
    bones = [part for part in parts if part not in ("skin", hull)]
    pairs = [(hull, "skin"), *((bone, outer) for bone in bones for outer in ("skin", hull))]
    for inner, outer in (pair for pair in pairs if pair[0] != pair[1]):
        inside, around = parts[inner], parts[outer].exterior
        problem, remedy = "", f"bring the {inner} inside the {outer}"
        if not parts[outer].contains_properly(inside):
            problem = f"lies outside the {outer}"
            if around.intersects(inside.exterior):
                at = around.intersection(inside.exterior).representative_point()
                problem = f"crosses or touches the {outer} near ({at.x:.1f}, {at.y:.1f})"
        elif (gap := around.distance(inside.exterior)) < clearance:
            problem = f"{gap:.2f} mm left to the {outer} where {clearance:.2f} are needed"
            remedy = "correct the contours or ask for less room"
        if problem:
            raise InputError(source, f"{inner}{where}", problem, remedy)
    for bone, other in combinations(reversed(bones), 2):
        if parts[bone].distance(parts[other]) < max(clearance, 1e-9):
            shared = parts[bone].intersection(parts[other]).area
            problem = f"touches or crosses the {other}" + (f": {shared:.2g} mm² lie in both" if shared else "")
            raise InputError(source, f"{bone}{where}", problem, "separate the two")


def _check_fascia(section: LegSection, polygons: dict[str, Polygon], source: str | Path) -> None:
    refused, thickness = partial(InputError, source, "fascia_thickness_mm"), section.fascia_thickness
    if not thickness > 0:
        raise refused(f"{thickness:g} mm is not positive", "give the fascia's thickness in mm (0.2-1.0 is usual)")
    thinnest = minimal_fat_thickness(section)
    if thickness >= thinnest:
        problem = f"the fascia ({thickness:g} mm) is thicker than the fat at its thinnest ({thinnest:.2f} mm)"
        raise refused(problem, "reduce the thickness or move the fascia inwards there")
    for bone in section.bones:
        room = polygons["fascia"].exterior.distance(polygons[bone])
        if thickness >= room:
            problem = f"the fascia's inner face ({thickness:g} mm inwards) meets the {bone} ({room:.2f} mm away)"
            raise refused(problem, f"reduce the thickness or leave room between fascia and {bone}")

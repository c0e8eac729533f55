"""From cross-sections of a leg's surfaces to a subject folder.

The input holds, for each level along the leg, outlines of the skin, the muscle's hull, tibia and
fibula: ``level_mm,part,loop,i,x_mm,y_mm``, as sections of segmented surfaces give them. Such
surfaces have no fascia, and the hull may meet the tibia or leave it outside (at the shin).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from shapely import Polygon, make_valid

from legfem.common.errors import InputError
from legfem.common.tables import read_table
from legfem.common.units import FloatArray
from legfem.geometry.contours import check_girth, check_section
from legfem.geometry.curve import resample_closed_curve
from legfem.geometry.section import PARTS, LegSection

HEADER = ("level_mm", "part", "loop", "i", "x_mm", "y_mm")
SURFACES = ("skin", "muscle_hull", "tibia", "fibula")
_INSIDE = 0.8
"""Share of a part's area that lies in the skin; outlines of two scans cross by some mm."""


@dataclass(frozen=True)
class Clearances:
    """Room that the parts of a section keep, so that it can be meshed; mm."""

    bone_to_fascia: float = 1.2
    """Between a bone and the fascia's inner face."""
    fascia_to_skin: float = 1.8
    """Least thickness of the fat; more where the fascia is thicker than this."""
    fascia_bridge: float = 10.0
    """Radius over which the fascia spans furrows of the hull, as a taut sheet does."""
    corner: float = 4.0
    """Least radius of the fascia's outward corners."""
    spacing: float = 1.5
    """Between the contours' points."""
    smoothing: float = 0.1
    """Root-mean-square distance that the smoothed contours may keep from the surfaces."""

    def fat(self, fascia_thickness: float) -> float:
        """Return the least thickness of the fat over a fascia (mm)."""
        return max(self.fascia_to_skin, 1.5 * fascia_thickness)


def read_cross_section(path: Path, level: float) -> dict[str, Polygon]:
    """Read the outlines of one level; the largest loop of each part.

    Parameters
    ----------
    path : Path
        CSV file, see the module.
    level : float
        mm, one of the file's.

    Returns
    -------
    dict of Polygon
        Keys ``skin``, ``muscle_hull``, ``tibia``, ``fibula``; mm.

    Raises
    ------
    InputError
        If the table can't be read, there is no such level, or a part is missing there.
    """
    table = read_table(Path(path), HEADER, text=("part",))
    levels = np.unique(table["level_mm"].to_numpy())
    here = table[np.isclose(table["level_mm"], level)]
    if here.empty:
        nearest = levels[int(np.argmin(np.abs(levels - level)))]
        raise InputError(
            path,
            "--level",
            f"there is no level {level:g} mm",
            f"the nearest is {nearest:g}; levels are {levels[0]:g} to {levels[-1]:g}",
        )
    outlines: dict[str, Polygon] = {}
    for part in SURFACES:
        rows = here[here["part"] == part]
        if rows.empty:
            raise InputError(
                path,
                part,
                f"missing at level {level:g} mm",
                "choose another level or add the outline",
            )
        loops = [
            _polygon(path, part, loop.sort_values("i")[["x_mm", "y_mm"]].to_numpy(np.float64))
            for _, loop in rows.groupby("loop")
        ]
        outlines[part] = max(loops, key=lambda polygon: polygon.area)
    return outlines


def section_from_outlines(
    outlines: Mapping[str, Polygon],
    fascia_thickness: float,
    source: str | Path,
    clearances: Clearances | None = None,
) -> LegSection:
    """Make a leg section of outlines of skin, muscle hull, tibia and fibula.

    The fascia's outer face is the hull joined with the bones and their clearance, its furrows
    bridged, kept off the skin. A bone that stands too close to the skin (the tibia at the shin)
    is cut back there.

    Parameters
    ----------
    outlines : mapping of Polygon
        As `read_cross_section` returns, mm.
    fascia_thickness : float
        mm.
    source : str or Path
        What errors name as the file.
    clearances : Clearances, optional
        Room to keep between the parts.

    Raises
    ------
    InputError
        If the outlines don't allow a section with these clearances.
    """
    room = clearances or Clearances()
    if not fascia_thickness > 0:
        raise InputError(
            source,
            "fascia_thickness_mm",
            f"{fascia_thickness:g} is not positive",
            "give it in mm (0.2-1.0 is usual)",
        )
    parts = nested_outlines(outlines, fascia_thickness, source, room)
    section = LegSection(
        skin=_ring(parts["skin"]),
        fascia=_ring(parts["muscle_hull"]),
        tibia=_ring(parts["tibia"]),
        fibula=_ring(parts["fibula"]),
        fascia_thickness=fascia_thickness,
    )
    check_section(section, source)
    _check_clearances(section, room.bone_to_fascia, room.fat(fascia_thickness), source)
    return section


def nested_outlines(
    outlines: Mapping[str, Polygon],
    fascia_thickness: float,
    source: str | Path,
    room: Clearances,
) -> dict[str, Polygon]:
    """Return smoothed outlines that nest with clearances: bones in the muscle's hull in the skin.

    Parameters
    ----------
    outlines : mapping of Polygon
        ``skin``, ``muscle_hull`` and the bones, mm.
    fascia_thickness : float
        Of the layer that is to lie inwards of the hull's outline, mm; 0 without one.
    source : str or Path
        What errors name as the file.
    room : Clearances
        Room to keep between the parts.

    Raises
    ------
    InputError
        If nothing is left of a part.
    """
    _check_order(outlines, source)
    fat = room.fat(fascia_thickness)
    skin = _smooth(outlines["skin"], room)
    # Smoothing moves the contours by some tenths of a mm: keep that much in hand.
    slack = 3 * room.smoothing
    bones = {}
    sheath = outlines["muscle_hull"]
    around = room.bone_to_fascia + fascia_thickness + slack
    for bone in (part for part in outlines if part not in ("skin", "muscle_hull")):
        inside = skin.buffer(-(fat + slack + around))
        bones[bone] = _smooth(
            largest_polygon(_opened(outlines[bone] & inside, 1.0), source, bone), room
        )
        sheath = sheath | bones[bone].buffer(around)
    sheath = largest_polygon(_closed(sheath, room.fascia_bridge), source, "muscle_hull")
    sheath = largest_polygon(
        _opened(sheath, room.corner) & skin.buffer(-(fat + slack)), source, "muscle_hull"
    )
    # Bones may stick out of the hull's rounded corners; and cutting made new corners.
    for bone in bones.values():
        sheath = sheath | bone.buffer(around)
    hull = _smooth(largest_polygon(_closed(sheath, room.corner), source, "muscle_hull"), room)
    return {"skin": skin, "muscle_hull": hull, **bones}


def _check_order(outlines: Mapping[str, Polygon], source: str | Path) -> None:
    """Check what nesting would hide: a part's size, and which lies in which."""
    skin, hull = outlines["skin"], outlines["muscle_hull"]
    check_girth(float(skin.exterior.length), source)
    for part, outline in outlines.items():
        if part != "skin" and (outline & skin).area < _INSIDE * outline.area:
            raise InputError(
                source, part, "lies outside the skin", f"are skin and {part} exchanged?"
            )
        if part not in ("skin", "muscle_hull") and outline.area > hull.area:
            raise InputError(
                source, part, "is larger than the muscle's hull",
                f"are muscle_hull and {part} exchanged?",
            )  # fmt: skip


def back_of_calf(section: LegSection) -> FloatArray:
    """Return the skin's rearmost point (largest y, for +y posterior); (2,), mm."""
    return np.array(section.skin[int(np.argmax(section.skin[:, 1]))])


def _check_clearances(section: LegSection, bone: float, fat: float, source: str | Path) -> None:
    fascia = section.polygon("fascia").exterior
    found = {
        f"fascia to {part}": fascia.distance(section.polygon(part).exterior)
        for part in PARTS
        if part != "fascia"
    }
    wanted = {
        "fascia to skin": fat,
        "fascia to tibia": bone + section.fascia_thickness,
        "fascia to fibula": bone + section.fascia_thickness,
    }
    for gap, least in wanted.items():
        if found[gap] < 0.9 * least:
            raise InputError(
                source,
                gap,
                f"{found[gap]:.2f} mm left where {least:.2f} are needed",
                "choose another level or correct the outlines",
            )


def _polygon(path: Path, part: str, points: FloatArray) -> Polygon:
    if len(points) < 4:
        raise InputError(path, part, f"{len(points)} points are too few", "give a closed outline")
    return largest_polygon(make_valid(Polygon(points)), path, part)


def largest_polygon(shape: object, source: str | Path, part: str) -> Polygon:
    """Return the largest of a geometry's polygons, without its holes.

    Raises
    ------
    InputError
        If it has none.
    """
    pieces = [p for p in getattr(shape, "geoms", [shape]) if isinstance(p, Polygon) and p.area > 0]
    if not pieces:
        raise InputError(
            source,
            part,
            "nothing is left of it inside the leg with the clearances",
            "choose another level or correct the outlines",
        )
    return Polygon(max(pieces, key=lambda piece: piece.area).exterior)


def _opened(shape: Polygon, radius: float) -> Polygon:
    return shape.buffer(-radius).buffer(radius)


def _closed(shape: Polygon, radius: float) -> Polygon:
    return shape.buffer(radius).buffer(-radius)


def _smooth(shape: Polygon, room: Clearances) -> Polygon:
    fine = resample_closed_curve(_ring(shape), room.spacing / 2)
    return Polygon(resample_closed_curve(fine, room.spacing, room.smoothing))


def _ring(polygon: Polygon) -> FloatArray:
    return np.asarray(polygon.exterior.coords, dtype=np.float64)[:-1]

"""From outlines of a leg's segmented parts at a level to a section that can be meshed.

There are outlines of the skin, the muscle's hull and the bones, as sections of segmented surfaces
give them. These have no fascia, and the hull may meet a bone, leave it outside (the tibia at the
shin), or be in pieces, muscle by muscle.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from shapely import GEOSException, Polygon, make_valid, union_all

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.geometry.contours import MOST_POINTS, MUSCLE_HULL, Loops, check_girth, check_section
from legfem.geometry.part_names import bones_of, part_named
from legfem.geometry.section import LegSection, resample_closed_curve

_INSIDE = 0.8
"""Share of a part's area that lies in the skin; outlines of two scans cross by some mm."""
_BARE = 0.5
"""Share of the skin without fat beyond which it is no skin."""
_TOUCHING = 0.2
"""Distance of skin and hull below which no fat lies between, mm."""
BRIDGE = 10.0
"""Radius (mm) over which separate muscles are joined: gaps of twice that are spanned."""
_MOST_WINDING = 5.0
"""Times its hull's that an outline is long: muscles' furrows make it twice as long."""
_SPECK = 0.02
"""Share of the largest piece's area below which a piece is no muscle."""


@dataclass(frozen=True)
class Clearances:
    """Room that the parts of a section keep, so that it can be meshed; mm."""

    bone_to_fascia: float = 1.2
    """Between a bone and the fascia's inner face."""
    fascia_to_skin: float = 1.8
    """Least thickness of the fat; more where the fascia is thicker than this."""
    between_bones: float = 1.2
    """Between two bones; the second is cut back there."""
    fascia_bridge: float = 10.0
    """Radius over which the fascia spans furrows of the hull, as a taut sheet does."""
    corner: float = 4.0
    """Least radius of the fascia's outward corners."""
    eroded: float = 1.5
    """By which labels of muscles may lie apart from what they are of, and the least radius of one."""
    spacing: float = 1.5
    """Between the contours' points."""
    smoothing: float = 0.1
    """Root-mean-square distance that the smoothed contours may keep from the surfaces."""

    def fat(self, fascia_thickness: float) -> float:
        """Return the least thickness of the fat over a fascia (mm)."""
        return max(self.fascia_to_skin, 1.5 * fascia_thickness)


def polygons_of(loops: Loops, path: Path, where: str, elsewhere: Collection[str] = ()) -> dict[str, Polygon]:
    """Return the outline of every part at a level: its largest, the muscles' joined.

    Parameters
    ----------
    loops : dict
        Part to its outlines, (m, 2) each, mm.
    path, where : Path, str
        What errors name as the file, and the level.
    elsewhere : collection of str
        Parts at other levels, which have to be here too.

    Raises
    ------
    InputError
        If a part is missing, or nothing says what it is.
    """
    named: Loops = {}
    for part, own in loops.items():
        named.setdefault(part_named(part, path), []).extend(own)
    every = {*named, *(part_named(part, path) for part in elsewhere)}
    bones, outlines = bones_of(every), dict[str, Polygon]()
    for part in ("skin", *({MUSCLE_HULL} & every), *bones):
        if part not in named:
            raise InputError(path, part, f"missing at {where}", "choose another level or add the outline")
        pieces = [_polygon(path, part, points) for points in named[part]]
        outlines[part] = outline_of(part, pieces, path, where)
    if not bones:
        raise InputError(path, "bones", f"there are none at {where}", "choose another level or add their outlines")
    return outlines


def outline_of(part: str, pieces: Sequence[Polygon], source: str | Path, where: str) -> Polygon:
    """Return a part's outline at a level: its largest piece, the muscles' `joined`."""
    return joined(pieces, source, where) if part == MUSCLE_HULL else max(pieces, key=lambda piece: piece.area)


def joined(pieces: Sequence[Polygon], source: str | Path, where: str, bridge: float = BRIDGE) -> Polygon:
    """Return the hull of muscles that were segmented apart from each other.

    Where they touch nothing is moved; else the hull spans their gaps, as a taut sheet does.

    Raises
    ------
    InputError
        If they are too far apart for that.
    """
    least = _SPECK * max(piece.area for piece in pieces)
    muscles = union_all([piece for piece in pieces if piece.area > least])
    if not isinstance(muscles, Polygon):
        muscles = _closed(muscles, bridge)
        apart = [p for p in getattr(muscles, "geoms", [muscles]) if p.area > least]
        if len(apart) > 1:
            problem = f"is in {len(apart)} pieces at {where}, more than {2 * bridge:g} mm apart"
            raise InputError(source, MUSCLE_HULL, problem, "segment what lies between them as muscle too")
    return largest_polygon(muscles, source, MUSCLE_HULL)


def section_from_outlines(
    outlines: Mapping[str, Polygon],
    fascia_thickness: float,
    source: str | Path,
    muscles: Mapping[str, Polygon] | None = None,
) -> LegSection:
    """Make a section of outlines of skin, muscle hull and bones.

    The fascia's outer face is the hull joined with the bones and their clearance, its furrows
    bridged, kept off the skin. A bone that stands too close to the skin (the tibia at the shin)
    is cut back there.

    Parameters
    ----------
    outlines : mapping of Polygon
        ``skin``, ``muscle_hull`` and the bones, mm.
    fascia_thickness : float
        mm.
    source : str or Path
        What errors name as the file.
    muscles : mapping of Polygon, optional
        Outlines of those in the hull that are regions of their own, mm: kept within the fascia and off the bones, and
        grown to what was labelled as theirs before labels were eroded.

    Raises
    ------
    InputError
        If the outlines don't allow a section with the usual clearances.
    """
    room = Clearances()
    if not fascia_thickness >= 0:
        remedy = "give it in mm (0.2-1.0 is usual), 0 without muscle"
        raise InputError(source, "fascia_thickness_mm", f"{fascia_thickness:g} is negative", remedy)
    bones = bones_of(outlines)
    hull = outlines.get(MUSCLE_HULL) if fascia_thickness else hull_of_bones(outlines)
    if hull is None:
        remedy = "add it; fascia_thickness_mm = 0 (--fascia-thickness) says that there is no muscle"
        raise InputError(source, MUSCLE_HULL, "the part is missing", remedy)
    parts = {"skin": outlines["skin"], MUSCLE_HULL: hull, **{bone: outlines[bone] for bone in bones}}
    rings = {part: _ring(one) for part, one in nested_outlines(parts, fascia_thickness, source, room).items()}
    within = Polygon(rings[MUSCLE_HULL]).buffer(-fascia_thickness)
    left = within - union_all([Polygon(rings[bone]) for bone in bones])
    own, drawn = dict[str, FloatArray](), muscles or {}
    for name, outline in drawn.items():
        others = union_all([other for key, other in drawn.items() if key != name])
        mine = _opened((outline.buffer(room.eroded) - others) & left, room.eroded)
        own[name] = _ring(_smooth(largest_polygon(mine, source, name), room))
        left = left - Polygon(own[name])
    section = LegSection.of_parts({"fascia": rings.pop(MUSCLE_HULL), **rings, **own}, fascia_thickness, own)
    check_section(section, source)
    if fascia_thickness:
        _check_clearances(section, room.bone_to_fascia, room.fat(fascia_thickness), source)
    return section


def hull_of_bones(outlines: Mapping[str, Polygon]) -> Polygon:
    """Return what stands for the hull of muscles where there are none: what the bones are within."""
    return union_all([outlines[bone] for bone in bones_of(outlines)]).convex_hull.buffer(1.0)


def nested_outlines(
    outlines: Mapping[str, Polygon], fascia_thickness: float, source: str | Path, room: Clearances
) -> dict[str, Polygon]:
    """Return smoothed outlines that nest with clearances: bones in the muscle's hull in the skin.

    Parameters
    ----------
    outlines : mapping of Polygon
        ``skin``, ``muscle_hull`` and the bones, mm.
    fascia_thickness : float
        Thickness of the layer that is to lie inwards of the hull's outline, mm; 0 without one.
    source : str or Path
        What errors name as the file.
    room : Clearances
        Room to keep between the parts.

    Raises
    ------
    InputError
        If nothing is left of a part, or outlines cross themselves.
    """
    try:
        return _nested(outlines, fascia_thickness, source, room)
    except GEOSException as error:
        problem = f"an outline crosses itself ({error})"
        raise InputError(source, "x_mm, y_mm", problem, "give points in order around each part") from None


def _nested(
    outlines: Mapping[str, Polygon], fascia_thickness: float, source: str | Path, room: Clearances
) -> dict[str, Polygon]:
    outlines = {part: _thinned(outline) for part, outline in outlines.items()}
    _check_order(outlines, source)
    fat = room.fat(fascia_thickness)
    skin = _smooth(outlines["skin"], room)
    # Smoothing moves the contours by some tenths of a mm: keep that much in hand.
    slack = 3 * room.smoothing
    bones: dict[str, Polygon] = {}
    sheath = outlines["muscle_hull"]
    around = room.bone_to_fascia + fascia_thickness + slack
    apart = room.between_bones + slack
    for bone in (part for part in outlines if part not in ("skin", "muscle_hull")):
        inside = skin.buffer(-(fat + slack + around))
        for other in bones.values():
            # Near the knee and the ankle the fibula meets the tibia.
            if other.distance(outlines[bone]) < apart:
                inside = inside - other.buffer(apart)
        bones[bone] = _smooth(largest_polygon(_opened(outlines[bone] & inside, 1.0), source, bone), room)
        sheath = sheath | bones[bone].buffer(around)
    sheath = largest_polygon(_closed(sheath, room.fascia_bridge), source, "muscle_hull")
    sheath = largest_polygon(_opened(sheath, room.corner) & skin.buffer(-(fat + slack)), source, "muscle_hull")
    # Bones may stick out of the hull's rounded corners; and cutting made new corners.
    for bone in bones.values():
        sheath = sheath | bone.buffer(around)
    hull = _smooth(largest_polygon(_closed(sheath, room.corner), source, "muscle_hull"), room)
    return {"skin": skin, "muscle_hull": hull, **bones}


def _check_order(outlines: Mapping[str, Polygon], source: str | Path) -> None:
    """Check what nesting would hide: a part's size, which lies in which, and a skin without fat."""
    skin, hull = outlines["skin"], outlines["muscle_hull"]
    check_girth(float(skin.exterior.length), source)
    bare = float((skin.exterior & hull.buffer(_TOUCHING)).length / skin.exterior.length)
    if bare > _BARE:
        problem = f"lies on the muscles' hull along {100 * bare:.0f} % of its length"
        remedy = "give the skin's outline, outside the fat: a scan without it can't be used"
        raise InputError(source, "skin", problem, remedy)
    for part, outline in outlines.items():
        if part != "skin" and (outline & skin).area < _INSIDE * outline.area:
            raise InputError(source, part, "lies outside the skin", f"are skin and {part} exchanged?")
        if part not in ("skin", "muscle_hull") and outline.area > hull.area:
            raise InputError(source, part, "is larger than the muscle's hull", f"are muscle_hull and {part} exchanged?")
    for other, bone in combinations(bones_of(outlines), 2):
        shared = float((outlines[bone] & outlines[other]).area)
        if shared > (1 - _INSIDE) * outlines[bone].area:
            problem = f"overlaps the {other}: {shared:.2g} mm² lie in both"
            raise InputError(source, bone, problem, "separate the two: nothing belongs to both")


def facing_point(section: LegSection, direction: FloatArray) -> FloatArray:
    """Return where the skin lies furthest against a direction of travel; (2,), mm.

    In the middle of what lies 3 mm behind it at most: of a round back alone the noise of a scan
    moves the furthest point by millimetres sideways.
    """
    before = -section.skin @ direction
    point: FloatArray = section.skin[before > before.max() - 3.0].mean(axis=0)
    return point + (point @ -direction - before.max()) * direction


def _check_clearances(section: LegSection, bone: float, fat: float, source: str | Path) -> None:
    fascia = section.polygon("fascia").exterior
    for part, least in {"skin": fat, **dict.fromkeys(section.bones, bone + section.fascia_thickness)}.items():
        gap = fascia.distance(section.polygon(part).exterior)
        if gap < 0.9 * least:
            problem = f"{gap:.2f} mm left where {least:.2f} are needed"
            raise InputError(source, f"fascia to {part}", problem, "choose another level or correct the outlines")


def _polygon(path: Path, part: str, points: FloatArray) -> Polygon:
    if len(points) < 4:
        raise InputError(path, part, f"{len(points)} points are too few", "give a closed outline")
    outline = Polygon(points)
    # Points in no order cross each other at every turn, which takes minutes to part.
    around = outline.convex_hull.length
    if outline.length > _MOST_WINDING * around:
        line = f"the line through them is {outline.length:.0f} mm long, and goes round {around:.0f} mm"
        remedy = "give them one after the other along the outline (column i)"
        raise InputError(path, part, f"its points are in no order: {line}", remedy)
    return largest_polygon(make_valid(outline), path, part)


def largest_polygon(shape: object, source: str | Path, part: str) -> Polygon:
    """Return the largest of a geometry's polygons, without its holes.

    Raises
    ------
    InputError
        If it has none.
    """
    pieces = [p for p in getattr(shape, "geoms", [shape]) if isinstance(p, Polygon) and p.area > 0]
    if not pieces:
        problem = "with the clearances nothing of it is left inside the leg"
        raise InputError(source, part, problem, "choose another level or correct the outlines")
    return Polygon(max(pieces, key=lambda piece: piece.area).exterior)


def _thinned(outline: Polygon) -> Polygon:
    """Return an outline without points closer than any mesh's, which only cost time."""
    ring = _ring(outline)
    return outline if len(ring) <= MOST_POINTS else Polygon(ring[:: 1 + len(ring) // MOST_POINTS])


def _opened(shape: Polygon, radius: float) -> Polygon:
    return shape.buffer(-radius).buffer(radius)


def _closed(shape: Polygon, radius: float) -> Polygon:
    return shape.buffer(radius).buffer(-radius)


def _smooth(shape: Polygon, room: Clearances) -> Polygon:
    fine = resample_closed_curve(_ring(shape), room.spacing / 2)
    return Polygon(resample_closed_curve(fine, room.spacing, room.smoothing))


def _ring(polygon: Polygon) -> FloatArray:
    return np.asarray(polygon.exterior.coords, dtype=np.float64)[:-1]

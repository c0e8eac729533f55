"""The leg's cross-section: closed contours by name, the fascia's thickness; smooth curves through contours' points."""

from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline, splev, splprep
from shapely import GeometryCollection, LinearRing, LineString, MultiPoint, Point, Polygon, get_coordinates
from shapely.geometry.base import BaseGeometry

from legfem.common.drawing import Pictured, svg
from legfem.common.resources import resource
from legfem.common.units import FloatArray, frozen_array

LAYERS = ("skin", "fascia")
"""Parts that every limb with muscle has; its bones have names of their own."""
MUSCLE, BONES = "muscle", "bones"
"""What a limb may lack."""
LIMBS = resource("bones", dict[str, tuple[str, ...]])
"""Bones that a section goes through, by limb, in the order that sections have them in."""
CALF = "calf"
_ON_PLATE_MM = 1.0
"""From the plate's face, within which skin rests on it."""


@dataclass(frozen=True, eq=False, repr=False)
class LegSection(Pictured):
    """Contours of one cross-section, in mm.

    Every contour is an (n, 2) read-only array, counter-clockwise, closed implicitly (the first
    point isn't repeated).

    Parameters
    ----------
    skin : (n, 2) array
        Outer contour of the leg.
    fascia : (n, 2) array
        Outer face of the fascia; the layer lies inwards of it.
    bones : mapping of str to (n, 2) array
        Name to outline of each bone.
    muscles : mapping of str to (n, 2) array
        Name to outline of each muscle that is known by itself; what they leave is deep tissue all the same.
    fascia_thickness : float
        Thickness of the fascia, mm; 0 of a limb without muscle, which is one tissue from the skin to the bones.
    groups : mapping of str to tuple of str
        Name to the muscles of each group that is taken as one.
    support : (2, 2) array, optional
        Two points of a plate's face, mm: skin that lies on it, or beyond it as seen from the middle, is held.
    """

    skin: FloatArray
    fascia: FloatArray
    bones: Mapping[str, FloatArray]
    fascia_thickness: float
    muscles: Mapping[str, FloatArray] = field(default_factory=dict)
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    support: FloatArray | None = None

    def __post_init__(self) -> None:
        """Copy the contours, drop a repeated end point and turn them counter-clockwise."""
        for part in LAYERS:
            object.__setattr__(self, part, frozen_array(_tidy(getattr(self, part))))
        for kind in ("bones", "muscles"):
            found = {name: frozen_array(_tidy(xy)) for name, xy in getattr(self, kind).items()}
            object.__setattr__(self, kind, found)

    @classmethod
    def of_parts(
        cls, contours: Mapping[str, FloatArray], fascia_thickness: float, muscles: Collection[str] = ()
    ) -> "LegSection":
        """Return the section of contours (n, 2), mm, by name; the others than `LAYERS` and muscles are bones."""
        bones = {name: xy for name, xy in contours.items() if name not in (*LAYERS, *muscles)}
        named = {name: contours[name] for name in muscles}
        fascia = contours["fascia"] if fascia_thickness else contours["skin"]
        return cls(contours["skin"], fascia, bones, fascia_thickness, named)

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of all contours: `LAYERS`, muscles, and the bones in their order."""
        return (*self.layers, *self.muscles, *self.bones)

    @property
    def layers(self) -> tuple[str, ...]:
        """Those of `LAYERS` that there are."""
        return LAYERS[:1] if MUSCLE in self.lacks else LAYERS

    @property
    def lacks(self) -> tuple[str, ...]:
        """What of `MUSCLE` and `BONES` there is none of; without muscle the fascia is the skin."""
        return tuple(what for what, there in ((MUSCLE, self.fascia_thickness), (BONES, self.bones)) if not there)

    def rests(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return which points (n, 2) of the skin lie on the plate, or beyond it."""
        start, end = np.full((2, 2), np.nan) if self.support is None else self.support
        square = across(end - start) / np.linalg.norm(end - start)
        side = np.sign((self.skin.mean(axis=0) - start) @ square)
        return np.asarray(side * ((points - start) @ square) < _ON_PLATE_MM)

    @property
    def held(self) -> BaseGeometry:
        """The bones, and the skin on the plate."""
        resting = self.skin[self.rests(self.skin)]
        return GeometryCollection([*(self.polygon(bone).exterior for bone in self.bones), MultiPoint(resting)])

    @property
    def limb(self) -> str:
        """Which of `LIMBS` has just these bones; empty where none does."""
        return next((limb for limb, bones in LIMBS.items() if set(bones) == set(self.bones)), "")

    def muscles_of(self, name: str) -> tuple[str, ...]:
        """Return the muscles of a group; of a muscle itself."""
        return self.groups.get(name, (name,))

    def contour(self, part: str) -> FloatArray:
        """Return the contour of ``part``, one of `parts`; (n, 2), mm."""
        return {"skin": self.skin, "fascia": self.fascia, **self.bones, **self.muscles}[part]

    def told(self) -> str:
        """Girth and thinnest fat."""
        return f"section with a girth of {girth(self):.0f} mm, fat of {minimal_fat_thickness(self):.1f} mm or more"

    def pictures(self) -> str:
        """Its contours, to scale."""
        return svg([np.vstack([ring, ring[:1]]) for ring in map(self.contour, self.parts)], self.told(), to_scale=True)

    def polygon(self, part: str) -> Polygon:
        """Return the region within the contour of ``part``, in mm."""
        return Polygon(self.contour(part))


def girth(section: LegSection) -> float:
    """Return the perimeter of the skin, mm."""
    return float(section.polygon("skin").length)


def fat_thickness(section: LegSection, point: FloatArray, direction: FloatArray | None = None) -> float:
    """Return the thickness of the fat, skin to the fascia's outer face, in mm; of a pad, to the bone.

    Parameters
    ----------
    section : LegSection
        The leg.
    point : (2,) array
        A point on the line along which to measure, mm; without ``direction`` a point near the
        skin.
    direction : (2,) array, optional
        Direction of travel into the leg. Without it, the shortest distance from the skin's
        point nearest to ``point`` to the fascia.

    Raises
    ------
    ValueError
        If the line misses the skin or the fascia.
    """
    skin, fascia = section.polygon("skin").exterior, section.polygon("fascia").exterior
    at = np.asarray(point, dtype=np.float64)
    if direction is None:
        return float(skin.interpolate(skin.project(Point(at))).distance(fascia))
    if MUSCLE in section.lacks:
        return depth_to_bone(section, at, direction)
    unit = np.asarray(direction, dtype=np.float64)
    unit = unit / np.linalg.norm(unit)
    return first_crossing(fascia, at, unit) - first_crossing(skin, at, unit)


def layer_thicknesses(section: LegSection, point: FloatArray, direction: FloatArray) -> dict[str, float]:
    """Return the thicknesses of fat, deep tissue and all along a line of travel, mm, as channels have them.

    Without ``muscle_thickness`` and ``tissue_thickness`` where the line meets no bone.

    Raises
    ------
    ValueError
        If the line misses the skin or the fascia.
    """
    deep = section.polygon("fascia").buffer(-section.fascia_thickness)
    found = {} if MUSCLE in section.lacks else {"fat_thickness": fat_thickness(section, point, direction)}
    if (met := way_to_bone(section, point, direction)) < np.inf:
        if found:
            found["muscle_thickness"] = met - first_crossing(deep.boundary, point, direction)
        found["tissue_thickness"] = met - first_crossing(section.polygon("skin").boundary, point, direction)
    return found


def way_to_bone(section: LegSection, point: FloatArray, direction: FloatArray, grown: float = 0.0) -> float:
    """Return where a line of travel first meets a bone, or what is some mm around one; infinite where it meets none."""
    met = [np.inf]
    for bone in map(section.polygon, section.bones):
        with suppress(ValueError):
            met.append(first_crossing((bone.buffer(grown) if grown else bone).exterior, point, direction))
    return min(met)


def depth_to_bone(section: LegSection, point: FloatArray, direction: FloatArray) -> float:
    """Return the distance to a bone, or to skin on the plate, from where a line of travel meets the skin, mm.

    Raises
    ------
    ValueError
        If the line misses the skin.
    """
    at, unit = np.asarray(point), np.asarray(direction) / np.linalg.norm(direction)
    return float(section.held.distance(Point(at + first_crossing(section.polygon("skin").exterior, at, unit) * unit)))


def across(direction: FloatArray) -> FloatArray:
    """Return a plane's directions (..., 2) turned by 90 degrees, counter-clockwise."""
    return np.array([-direction[..., 1], direction[..., 0]]).T


def cross(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the cross products of vectors (..., 2)."""
    return np.asarray(one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0])


_CHORD_MM = 15.0


def line_of_travel(section: LegSection, point: FloatArray) -> tuple[FloatArray, float]:
    """Skin's point (2,) next to a point (2,), mm, and the direction inwards from there, degrees from +x.

    The direction is square to the chord of the skin within 15 mm of it.
    """
    skin = LinearRing(section.skin)
    at = skin.project(Point(point))
    near = [np.array(skin.interpolate((at + way) % skin.length).coords[0]) for way in (-_CHORD_MM, 0.0, _CHORD_MM)]
    along = near[2] - near[0]
    inward = across(along)  # contours are counter-clockwise
    return near[1], float(np.degrees(np.arctan2(inward[1], inward[0]))) % 360.0


def minimal_fat_thickness(section: LegSection) -> float:
    """Return the shortest distance between skin and the fascia's outer face, mm."""
    return float(section.polygon("skin").exterior.distance(section.polygon("fascia").exterior))


def first_crossing(curve: BaseGeometry, point: FloatArray, direction: FloatArray) -> float:
    """Return where a line of travel first meets a curve, in mm along it from ``point``.

    Negative when the curve is met before the point is reached.

    Raises
    ------
    ValueError
        If the line never meets the curve.
    """
    x0, y0, x1, y1 = curve.bounds
    reach = float(np.hypot(x1 - x0, y1 - y0) + np.hypot(point[0] - x0, point[1] - y0)) + 1.0
    line = LineString([point - reach * direction, point + reach * direction])
    hits = line.intersection(curve)
    if hits.is_empty:
        raise ValueError("the line of travel misses the contour")
    return float(np.min((get_coordinates(hits) - point) @ direction))


def _tidy(points: FloatArray) -> FloatArray:
    xy = np.asarray(points, dtype=np.float64)
    if xy.ndim != 2 or xy.shape[1] != 2:
        raise ValueError(f"a contour is an (n, 2) array, not {xy.shape}")
    step = np.linalg.norm(xy - np.roll(xy, 1, axis=0), axis=1)
    kept = xy[step > 1e-9 * (1.0 + np.abs(xy).max(initial=0.0))]
    return np.asarray(kept if cross(kept, np.roll(kept, -1, axis=0)).sum() > 0 else kept[::-1])


@dataclass(frozen=True, eq=False)
class ClosedCurve:
    """A periodic cubic curve: ``curve(s)`` is (m, 2) in mm for s in turns (s and s + 1 agree).

    s runs with the points' order, nearly in proportion to arc length.
    """

    spline: CubicSpline = field(repr=False)
    length: float

    def __call__(self, s: ArrayLike) -> FloatArray:
        """Return the points at ``s`` (in turns); (..., 2), mm."""
        return np.asarray(self.spline(np.mod(s, 1.0)), dtype=np.float64)

    def tangent(self, s: ArrayLike) -> FloatArray:
        """Return the unit tangents at ``s`` (in turns); (..., 2)."""
        slope = np.asarray(self.spline(np.mod(s, 1.0), 1), dtype=np.float64)
        return np.asarray(slope / np.linalg.norm(slope, axis=-1, keepdims=True))

    def evenly(self, n: int) -> FloatArray:
        """Return ``n`` points evenly spaced along the arc; (n, 2), mm."""
        fine = np.linspace(0.0, 1.0, max(8 * n, 1024) + 1)
        arc = arc_lengths(self(fine))
        return self(np.interp(np.arange(n) / n * arc[-1], arc, fine))


def smooth_closed_curve(points: ArrayLike, smoothing: float = 0.0) -> ClosedCurve:
    """Return a periodic cubic spline through (or near) the points of a closed contour.

    Parameters
    ----------
    points : (n, 2) array
        The contour, mm; a repeated end point and uneven spacing do no harm.
    smoothing : float
        Root-mean-square distance, mm, that the curve may keep from the points; 0 interpolates.

    Raises
    ------
    ValueError
        If fewer than four distinct points are given, or one isn't finite.
    """
    xy = _distinct(np.asarray(points, dtype=np.float64))
    ring = np.vstack([xy, xy[:1]])
    arc = arc_lengths(ring)
    if smoothing > 0:
        turns = arc / arc[-1]
        near, _ = splprep(ring.T, u=turns, k=3, s=len(ring) * smoothing**2, per=True)
        ring = np.column_stack(splev(np.linspace(0.0, 1.0, max(2 * len(xy), 64) + 1), near))
        ring[-1] = ring[0]
        arc = arc_lengths(ring)
    spline = CubicSpline(arc / arc[-1], ring, bc_type="periodic")
    return ClosedCurve(spline, float(arc_lengths(spline(np.linspace(0.0, 1.0, 4 * len(ring) + 1)))[-1]))


def resample_closed_curve(points: ArrayLike, spacing: float, smoothing: float = 0.0) -> FloatArray:
    """Return the contour resampled evenly at about ``spacing`` mm; (m, 2), m >= 8.

    Raises
    ------
    ValueError
        If ``spacing`` isn't positive, or as `smooth_closed_curve` does.
    """
    if not spacing > 0:
        raise ValueError(f"spacing must be positive, not {spacing}")
    curve = smooth_closed_curve(points, smoothing)
    return curve.evenly(max(8, round(curve.length / spacing)))


def closed_lengths(contours: FloatArray) -> FloatArray:
    """Return the lengths of closed contours (..., n, 2) by their chords, (...)."""
    return np.asarray(np.linalg.norm(contours - np.roll(contours, 1, axis=-2), axis=-1).sum(-1))


def outward_normals(contours: FloatArray) -> FloatArray:
    """Return the unit normals of counter-clockwise contours, (..., n_points, 2), by chords."""
    tangent = np.roll(contours, -1, axis=-2) - np.roll(contours, 1, axis=-2)
    outwards = np.stack([tangent[..., 1], -tangent[..., 0]], axis=-1)
    return np.asarray(outwards / np.linalg.norm(outwards, axis=-1, keepdims=True))


def each_at(splines: CubicSpline, at: FloatArray) -> FloatArray:
    """Return the values of many splines on the same knots, each at places of its own.

    Parameters
    ----------
    splines : CubicSpline
        Splines of values (n_knots, k, d).
    at : (m, k) array
        Places on each of the k splines.

    Returns
    -------
    ndarray
        (m, k, d).
    """
    last = len(splines.x) - 2
    piece = np.clip(np.searchsorted(splines.x, at, side="right") - 1, 0, last)
    coefficients = splines.c[:, piece, np.arange(at.shape[1])]
    offset = (at - splines.x[piece])[..., None]
    values = coefficients[0]
    for coefficient in coefficients[1:]:
        values = values * offset + coefficient
    return np.asarray(values)


def area_and_centroid(ring: FloatArray) -> tuple[float, FloatArray]:
    """Return the signed area of a closed polygon, positive counter-clockwise, and its centroid.

    Parameters
    ----------
    ring : (n, 2) array
        Its corners in order, mm; the first may be repeated at the end.

    Returns
    -------
    float, ndarray
        mm2; (2,), mm.
    """
    middle = ring.mean(axis=0)  # nearby, so that no digits are lost
    x, y = (ring - middle).T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    area = 0.5 * float(cross.sum())
    sums = np.array([((x + np.roll(x, -1)) * cross).sum(), ((y + np.roll(y, -1)) * cross).sum()])
    return area, middle + sums / (6 * area)


def _distinct(xy: FloatArray) -> FloatArray:
    if xy.ndim != 2 or xy.shape[1] != 2 or not np.isfinite(xy).all():
        raise ValueError("a contour is an (n, 2) array of finite numbers")
    scale = float(np.linalg.norm(np.ptp(xy, axis=0)))
    step = np.linalg.norm(xy - np.roll(xy, 1, axis=0), axis=1)
    kept: FloatArray = xy[step > 1e-6 * scale]
    if len(kept) < 4:
        raise ValueError("a closed curve needs at least four distinct points")
    return kept


def arc_lengths(ring: FloatArray) -> FloatArray:
    """Return the length of a line through points (n, d) up to each of them, (n,)."""
    return np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))]

"""Slices of a leg on which a simulated shape is compared with a target: the paper's contour cost.

The second paper compares outer and inner contours of the superficial tissue (skin and hull) in five
slices over 3 cm of the calf.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import ArrayLike
from scipy.interpolate import make_interp_spline

from legfem.common.errors import InputError
from legfem.common.units import FloatArray, freeze
from legfem.geometry.leg_shape import HULL, SKIN, LegShape, largest_girth
from legfem.geometry.section import arc_lengths, cross, outward_normals, smooth_closed_curve

CONTOURS = ("outer", "inner")
_PART = {"outer": SKIN, "inner": HULL}
_FINER = 8  # points of the contour that is met, for one of its own


@dataclass(frozen=True, eq=False)
class SliceSet:
    """Outer and inner contours of the superficial tissue in a few slices.

    Parameters
    ----------
    levels : (n_slices,) array
        mm.
    outer, inner : (n_slices, n_points, 2) array
        Counter-clockwise and evenly spaced, mm; see `legfem.geometry.leg_shape`.
    """

    levels: FloatArray
    outer: FloatArray
    inner: FloatArray

    def __post_init__(self) -> None:
        """Copy the arrays."""
        freeze(self, "levels", *CONTOURS)

    @staticmethod
    def of(shape: LegShape, levels: ArrayLike) -> "SliceSet":
        """Return the slices of a shape at some levels (mm).

        Raises
        ------
        InputError
            If a level is outside the segment.
        """
        z = np.atleast_1d(np.asarray(levels, dtype=np.float64))
        return SliceSet(z, shape.at(SKIN, z), shape.at(HULL, z))

    def contours(self, name: str) -> FloatArray:
        """Return the ``outer`` or ``inner`` contours."""
        return np.asarray(getattr(self, name))


_HEIGHT_MM = 30.0
"""Height of the calf over which slices are spread."""
_WITHIN = 5.0
"""mm: a leg that is moved a little as a whole, or turned, still has all of its slices."""


def calf_levels(shape: LegShape) -> FloatArray:
    """Return the levels of five slices over 3 cm of the calf, mm.

    Their middle is where the girth is largest, moved as far as it takes to keep all slices within the leg, and
    `_WITHIN` off its ends.

    Raises
    ------
    InputError
        If the segment is shorter than the slices need.
    """
    low, high = float(shape.levels[0]), float(shape.levels[-1])
    if high - low < _HEIGHT_MM:
        problem = f"{high - low:g} mm of leg are too short for slices over {_HEIGHT_MM:g} mm"
        raise InputError("shape", "levels", problem, "give a longer segment")
    room = _HEIGHT_MM / 2 + min(_WITHIN, (high - low - _HEIGHT_MM) / 2)
    centre = float(np.clip(largest_girth(shape), low + room, high - room))
    return centre + np.linspace(-_HEIGHT_MM / 2, _HEIGHT_MM / 2, 5)


def signed_distances(reference: FloatArray, other: FloatArray) -> FloatArray:
    """Return how far another contour lies from points of a contour, along its normals.

    Parameters
    ----------
    reference : (n, 2) array
        Closed contour, counter-clockwise, mm.
    other : (m, 2) array
        Closed contour, mm.

    Returns
    -------
    ndarray
        (n,), mm; positive where ``other`` is outside. Where a normal does not meet it, the shortest
        distance.
    """
    curve = smooth_closed_curve(reference)
    arc = arc_lengths(np.vstack([reference, reference[:1]]))
    tangent = curve.tangent(arc[:-1] / arc[-1])
    normal = np.column_stack([tangent[:, 1], -tangent[:, 0]])
    ring = smooth_closed_curve(other).evenly(_FINER * len(other))
    edge = np.roll(ring, -1, axis=0) - ring
    to_start = ring[None, :, :] - reference[:, None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        across = cross(normal[:, None, :], edge[None, :, :])
        along_edge = cross(to_start, normal[:, None, :]) / across
        along_normal = cross(to_start, edge[None, :, :]) / across
    met = (along_edge >= -1e-12) & (along_edge < 1.0)
    distance = np.where(met, along_normal, np.inf)
    found: FloatArray = distance[np.arange(len(reference)), np.argmin(np.abs(distance), axis=1)]
    missed = ~np.isfinite(found)
    if missed.any():
        points, polygon = shapely.points(reference[missed]), shapely.Polygon(ring)
        inside = shapely.contains_xy(polygon, *reference[missed].T)
        found[missed] = np.where(inside, 1, -1) * shapely.distance(points, polygon.exterior)
    return found


def slice_distances(reference: SliceSet, other: SliceSet) -> dict[str, FloatArray]:
    """Return the signed distances of ``other`` from ``reference``, slice by slice.

    Returns
    -------
    dict
        ``outer`` and ``inner``: (n_slices, n_points) at the reference's points, mm.

    Raises
    ------
    ValueError
        If the two stand at different levels.
    """
    if reference.levels.shape != other.levels.shape or not np.allclose(reference.levels, other.levels):
        raise ValueError("slices at different levels can't be compared")
    pairs = {name: zip(reference.contours(name), other.contours(name), strict=True) for name in CONTOURS}
    return {name: np.stack([signed_distances(*pair) for pair in own]) for name, own in pairs.items()}


def distance_rates(reference: SliceSet, shape: LegShape, rates: Mapping[str, FloatArray]) -> FloatArray:
    """Return the rates of the signed distances of a moving shape.

    To first order in its distance from the reference and in the difference of their normals.

    Parameters
    ----------
    reference : SliceSet
        Whose points the distances are from.
    shape : LegShape
        Near it.
    rates : mapping of str to (n_levels, n_points, 3, m) array
        Velocities of the points of skin and hull, in m motions.

    Returns
    -------
    ndarray
        (n, m): skin first, slice by slice, at the reference's points.
    """
    found = []
    for name in CONTOURS:
        part = _PART[name]
        moved = rates[part]
        lines = shape.at(part, shape.levels, slope=1)
        # What leaves a level's plane moves the contour in it where lines along the leg slant.
        level = moved[:, :, :2] - moved[:, :, 2:] * lines[..., None]
        across = np.einsum("lpd,lpdm->lpm", outward_normals(shape.contours[part]), level)
        degree = min(3, len(shape.levels) - 1)
        sliced = make_interp_spline(shape.levels, across, k=degree)(reference.levels)
        for contour, ring, own in zip(reference.contours(name), shape.at(part, reference.levels), sliced, strict=True):
            # Straight between the contour's points, where the reference is nearest to it.
            at = shapely.line_locate_point(shapely.LinearRing(ring), shapely.points(contour))
            arc = arc_lengths(np.vstack([ring, ring[:1]]))
            found.append(make_interp_spline(arc, np.concatenate([own, own[:1]]), k=1)(at))
    return np.concatenate(found)

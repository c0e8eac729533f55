"""The shape of a segment of a leg: smooth closed contours of every part at levels along it.

z points along the leg. The parts are ``skin``, ``hull`` (the outer face of the deep tissue) and the
bones, which may have any names. A part's contours hold the same number of points at every level, in
correspondence: counter-clockwise and evenly spaced, from where the ray from the contour's centroid
along +x leaves it. Checks of a shape, what is measured on it level by level, and its surfaces (triangulated ones with
values on them, and smooth functions around and along a part) stand here too.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline, RectBivariateSpline, make_interp_spline
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree
from shapely import Polygon

from legfem.common.errors import InputError
from legfem.common.units import FloatArray, frozen_array
from legfem.geometry.contours import check_levels, check_nested
from legfem.geometry.section import arc_lengths, area_and_centroid, closed_lengths, each_at, smooth_closed_curve

SKIN, HULL = "skin", "hull"


@dataclass(frozen=True, eq=False)
class LegShape:
    """Contours of a leg's parts at levels along it.

    Parameters
    ----------
    levels : (n_levels,) array
        Increasing z, mm.
    contours : mapping of str to (n_levels, n_points, 2) array
        Part to its contours, mm; n_points may differ between parts. See `shape_of_contours` for
        contours that do not correspond yet.

    Raises
    ------
    InputError
        If skin, hull or all bones are missing, the arrays do not fit, or the levels do not
        increase.
    """

    levels: FloatArray
    contours: Mapping[str, FloatArray]

    def __reduce__(self) -> "tuple[type[LegShape], tuple[FloatArray, dict[str, FloatArray]]]":
        """Travel as what it is made from."""
        return LegShape, (self.levels, dict(self.contours))

    def __post_init__(self) -> None:
        """Copy and check the arrays."""
        levels = frozen_array(self.levels)
        contours = {part: frozen_array(xy) for part, xy in self.contours.items()}
        object.__setattr__(self, "levels", levels)
        object.__setattr__(self, "contours", MappingProxyType(contours))
        if levels.ndim != 1 or len(levels) < 2 or not (np.diff(levels) > 0).all():
            raise InputError("shape", "levels", "two or more increasing levels are needed", "sort them")
        for part in (SKIN, HULL):
            if part not in contours:
                raise InputError("shape", part, "the part is missing", "give its contours")
        if not self.bones:
            raise InputError("shape", "bones", "there are none", "give the contours of one or more")
        for part, xy in contours.items():
            if xy.ndim != 3 or xy.shape[0] != len(levels) or xy.shape[2] != 2 or xy.shape[1] < 8:
                problem = f"contours of shape {xy.shape} do not fit {len(levels)} levels"
                raise InputError("shape", part, problem, "give one closed contour of 8 or more points a level")
            if not np.isfinite(xy).all():
                raise InputError("shape", part, "a coordinate is not finite", "remove the point")

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of all parts: skin, hull, and the bones in their order."""
        return (SKIN, HULL, *self.bones)

    @property
    def bones(self) -> tuple[str, ...]:
        """Names of the bones."""
        return tuple(part for part in self.contours if part not in (SKIN, HULL))

    @property
    def length(self) -> float:
        """Length of the segment, mm."""
        return float(self.levels[-1] - self.levels[0])

    @cached_property
    def _splines(self) -> dict[str, Any]:
        degree = min(3, len(self.levels) - 1)
        return {part: make_interp_spline(self.levels, xy, k=degree, axis=0) for part, xy in self.contours.items()}

    def at(self, part: str, level: ArrayLike, slope: int = 0) -> FloatArray:
        """Return the contour of a part at a level, or at several.

        Parameters
        ----------
        part : str
            One of `parts`.
        level : float or (m,) array
            z, mm; between levels the points follow cubic splines along the leg.
        slope : int
            Order of the derivative along z to return instead of the points.

        Returns
        -------
        ndarray
            (n_points, 2) or (m, n_points, 2), mm.

        Raises
        ------
        InputError
            If a level is outside the segment.
        """
        z = np.asarray(level, dtype=np.float64)
        slack = 1e-9 * self.length
        if z.size and (z.min() < self.levels[0] - slack or z.max() > self.levels[-1] + slack):
            within = f"is not within the segment, {self.levels[0]:g} to {self.levels[-1]:g} mm"
            raise InputError("shape", "level", f"{z.min():g} to {z.max():g} mm {within}", "choose levels within it")
        z = np.clip(z, self.levels[0], self.levels[-1])
        return np.asarray(self._splines[part](z, nu=slope), dtype=np.float64)

    def points(self, part: str) -> FloatArray:
        """Return the points of a part in space, (n_levels, n_points, 3), mm."""
        xy = self.contours[part]
        return np.concatenate([xy, np.broadcast_to(self.levels[:, None, None], (*xy.shape[:2], 1))], axis=2)

    def at_levels(self, levels: ArrayLike) -> "LegShape":
        """Return the shape at other levels (mm) within the segment."""
        z = np.asarray(levels, dtype=np.float64)
        return LegShape(z, {part: self.at(part, z) for part in self.contours})


def corresponding(contour: ArrayLike, n_points: int) -> FloatArray:
    """Return a closed contour as `LegShape` wants it: turned, started and spaced alike.

    Parameters
    ----------
    contour : (n, 2) array
        In order around it, either way, mm.
    n_points : int
        How many to return.

    Raises
    ------
    ValueError
        If it is no closed curve (see `legfem.geometry.section.smooth_closed_curve`).
    """
    curve = smooth_closed_curve(contour)
    turns = _fine(n_points)
    return curve(_even_turns(turns, curve(turns), n_points))


def corresponding_loops(contours: FloatArray) -> FloatArray:
    """Return closed contours (n_levels, n_points, 2) as `corresponding` does, all at once.

    Their points lie about evenly already.
    """
    count = contours.shape[1]
    rings = np.concatenate([contours, contours[:, :1]], axis=1).swapaxes(0, 1)
    curves = CubicSpline(np.linspace(0.0, 1.0, count + 1), rings, bc_type="periodic")
    turns = _fine(count)
    even = [_even_turns(turns, fine, count) for fine in curves(turns).swapaxes(0, 1)]
    return each_at(curves, np.stack(even, axis=1)).swapaxes(0, 1)


def _fine(n_points: int) -> FloatArray:
    return np.linspace(0.0, 1.0, max(8 * n_points, 1024) + 1)


def _even_turns(turns: FloatArray, fine: FloatArray, n_points: int) -> FloatArray:
    """Return where on a closed curve, (n,) turns, points lie evenly as `LegShape` wants them.

    ``fine`` (m, 2) are its points at ``turns`` (m,).
    """
    area, centre = area_and_centroid(fine[:-1])
    if area < 0:
        turns, fine = turns[::-1], fine[::-1]
    arc = arc_lengths(fine)
    x, y = (fine - centre).T
    upwards = np.flatnonzero((y[:-1] <= 0) & (y[1:] > 0))
    share = -y[upwards] / (y[upwards + 1] - y[upwards])
    crossing = x[upwards] + share * (x[upwards + 1] - x[upwards])
    if len(crossing) == 0:
        raise ValueError("it encloses nothing")
    outermost = int(np.argmax(crossing))
    first = int(upwards[outermost])
    start = arc[first] + share[outermost] * (arc[first + 1] - arc[first])
    wanted = np.mod(start + np.arange(n_points) / n_points * arc[-1], arc[-1])
    return np.interp(wanted, arc, turns)


def shape_of_contours(
    levels: ArrayLike, contours: Mapping[str, list[FloatArray]], n_points: int | Mapping[str, int] = 180
) -> LegShape:
    """Make a shape of contours that do not correspond yet.

    Parameters
    ----------
    levels : (n_levels,) array
        mm.
    contours : mapping of str to list of (n, 2) array
        Part to its contour at every level, mm.
    n_points : int or mapping
        Points a contour; by part if a mapping.
    """
    made = {}
    for part, loops in contours.items():
        n = n_points if isinstance(n_points, int) else n_points[part]
        made[part] = np.stack([corresponding(loop, n) for loop in loops])
    return LegShape(np.asarray(levels, dtype=np.float64), made)


def check_shape(shape: LegShape, source: str | Path, clearance: float = 0.0, leg_sized: bool = True) -> None:
    """Check that the parts of a shape nest at every level.

    Parameters
    ----------
    shape : LegShape
        The shape.
    source : str or Path
        What errors name as the file.
    clearance : float
        Least distance that is wanted between the parts (mm).
    leg_sized : bool
        Whether the girth has to be a leg's.

    Raises
    ------
    InputError
        If a contour crosses itself, a part is not inside the one around it with the clearance, or
        the girth is not a leg's in mm.
    """
    if leg_sized:
        check_levels(shape.levels, source)
    for k, level in enumerate(shape.levels):
        here = {part: Polygon(xy[k]) for part, xy in shape.contours.items()}
        check_nested(here, HULL, source, f", level {level:g} mm", clearance, leg_sized)


def perimeter(shape: LegShape, part: str = SKIN) -> FloatArray:
    """Return the perimeter of a part at every level, (n_levels,), mm."""
    return closed_lengths(shape.contours[part])


def largest_girth(shape: LegShape) -> float:
    """Return the level at which the skin's perimeter is largest, mm."""
    return float(shape.levels[int(np.argmax(perimeter(shape)))])


def fat_thickness_around(shape: LegShape) -> FloatArray:
    """Return the shortest distance to the hull, in its plane, of every point of the skin.

    Returns
    -------
    ndarray
        (n_levels, n_points of the skin), mm.
    """
    hulls = shapely.linearrings(shape.contours[HULL])
    return np.asarray(shapely.distance(shapely.points(shape.contours[SKIN]), hulls[:, None]))


CANDIDATES = 24


@dataclass(frozen=True, eq=False)
class TriangleSurface:
    """A surface of flat triangles.

    Parameters
    ----------
    points : (n, 3) array
        mm.
    triangles : (m, 3) int array
        Indices of points.
    """

    points: FloatArray
    triangles: NDArray[np.int64]

    def weights(self, points: FloatArray) -> csr_matrix:
        """Return the matrix that interpolates values at the surface's points to points nearby.

        Parameters
        ----------
        points : (k, 3) array
            mm; each takes the value of the surface's point nearest to it.

        Returns
        -------
        csr_matrix
            (k, n), rows of three weights that sum to one.
        """
        import trimesh  # slow to import, and of use to a leg in 3D alone

        corners = self.points[self.triangles]
        count = min(CANDIDATES, len(corners))
        _, nearest = cKDTree(corners.mean(axis=1)).query(points, k=count)
        nearest = np.asarray(nearest).reshape(len(points), count)
        pairs = corners[nearest].reshape(-1, 3, 3)
        closest = trimesh.triangles.closest_point(pairs, np.repeat(points, count, axis=0))
        weights = trimesh.triangles.points_to_barycentric(pairs, closest).reshape(len(points), count, 3)
        on = closest.reshape(len(points), count, 3)
        best = np.argmin(np.linalg.norm(on - points[:, None], axis=2), axis=1)
        rows = np.arange(len(points))
        columns = self.triangles[nearest[rows, best]]
        indices = (np.repeat(rows, 3), columns.ravel())
        return csr_matrix((weights[rows, best].ravel(), indices), (len(points), len(self.points)))


def tube(levels: int, around: int) -> NDArray[np.int64]:
    """Return the triangles of a tube of points numbered by level and around, (m, 3)."""
    level, point = np.meshgrid(np.arange(levels - 1), np.arange(around), indexing="ij")
    a = (level * around + point).ravel()
    b = (level * around + (point + 1) % around).ravel()
    lower = np.stack([a, b, b + around], axis=1)
    return np.concatenate([lower, np.stack([a, b + around, a + around], axis=1)])


_SPACING = 2.0
"""Spacing of the points among which the nearest is looked for first (mm)."""
_CORRECTIONS = 4
"""Newton steps for a position around the leg; they converge quadratically near the surface."""
_WRAPPED = 6  # points repeated beyond the contour's start and end, for a periodic spline


class PartSurface:
    """Bicubic surface through the contours of one part.

    Parameters
    ----------
    shape : LegShape
        The leg.
    part : str
        One of its parts.
    """

    def __init__(self, shape: LegShape, part: str) -> None:
        xy = shape.contours[part]
        self._levels = shape.levels
        n = xy.shape[1]
        turns = np.arange(-_WRAPPED, n + _WRAPPED) / n
        wrapped = np.take(xy, np.arange(-_WRAPPED, n + _WRAPPED) % n, axis=1)
        degree = min(3, len(shape.levels) - 1)
        self._coordinates = [
            RectBivariateSpline(shape.levels, turns, wrapped[..., k], kx=degree, ky=3) for k in range(2)
        ]
        self.perimeter = float(closed_lengths(xy).mean())
        """Mean along the leg, mm."""

    def __call__(self, turns: ArrayLike, levels: ArrayLike) -> FloatArray:
        """Return the points at a position around (in turns) and along the leg (z, mm); (..., 3)."""
        u, z = np.broadcast_arrays(np.mod(turns, 1.0), np.asarray(levels, dtype=np.float64))
        x, y = (coordinate.ev(z, u) for coordinate in self._coordinates)
        return np.stack([x, y, z], axis=-1)

    def nearest_at_level(self, points: FloatArray) -> FloatArray:
        """Return the nearest points of the surface at the levels of points near it, (n, 3)."""
        xy, z = points[:, :2], np.clip(points[:, 2], self._levels[0], self._levels[-1])
        around = np.arange(0.0, 1.0, _SPACING / self.perimeter)
        along = np.linspace(z.min(), z.max(), 2 + int(np.ptp(z) / _SPACING))
        sampled = self(around[:, None], along[None, :])
        _, nearest = cKDTree(sampled.reshape(-1, 3)).query(np.column_stack([xy, z]))
        u = around[nearest // len(along)]
        for _ in range(_CORRECTIONS):
            missed = xy - self(u, z)[:, :2]
            slope = np.column_stack([coordinate.ev(z, np.mod(u, 1.0), dy=1) for coordinate in self._coordinates])
            u = u + np.einsum("ij,ij->i", missed, slope) / np.einsum("ij,ij->i", slope, slope)
        return self(u, z)

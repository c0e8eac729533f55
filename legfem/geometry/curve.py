"""Smooth closed curves through contour points."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, splev, splprep

from legfem.common.units import FloatArray


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
        unit: FloatArray = slope / np.linalg.norm(slope, axis=-1, keepdims=True)
        return unit

    def evenly(self, n: int) -> FloatArray:
        """Return ``n`` points evenly spaced along the arc; (n, 2), mm."""
        fine = np.linspace(0.0, 1.0, max(8 * n, 1024) + 1)
        arc = _arc_length(self(fine))
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
    arc = _arc_length(ring)
    if smoothing > 0:
        turns = arc / arc[-1]
        near, _ = splprep(ring.T, u=turns, k=3, s=len(ring) * smoothing**2, per=True)
        n = max(2 * len(xy), 64)
        ring = np.column_stack(splev(np.linspace(0.0, 1.0, n + 1), near))
        ring[-1] = ring[0]
        arc = _arc_length(ring)
    spline = CubicSpline(arc / arc[-1], ring, bc_type="periodic")
    length = float(_arc_length(spline(np.linspace(0.0, 1.0, 4 * len(ring) + 1)))[-1])
    return ClosedCurve(spline, length)


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
    length: FloatArray = np.linalg.norm(contours - np.roll(contours, 1, axis=-2), axis=-1).sum(-1)
    return length


def outward_normals(contours: FloatArray) -> FloatArray:
    """Return the unit normals of counter-clockwise contours, (..., n_points, 2), by chords."""
    tangent = np.roll(contours, -1, axis=-2) - np.roll(contours, 1, axis=-2)
    outwards = np.stack([tangent[..., 1], -tangent[..., 0]], axis=-1)
    unit: FloatArray = outwards / np.linalg.norm(outwards, axis=-1, keepdims=True)
    return unit


def at_own_places(splines: CubicSpline, at: FloatArray) -> FloatArray:
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


def _arc_length(ring: FloatArray) -> FloatArray:
    steps = np.linalg.norm(np.diff(ring, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])

r"""Pressure of a stocking by Laplace's law.

A thin fabric under the tension :math:`T` (N per mm of height) presses with

.. math:: p = T \kappa, \qquad T = k\, (L / L_0 - 1),

where :math:`\kappa` is the horizontal curvature of the leg as it is compressed, :math:`L` the
perimeter that the fabric spans, :math:`L_0` its perimeter unstretched and :math:`k` its stiffness.
L. Dubuis et al., MICCAI workshop (2012).

Where the leg is concave (at the shin) the fabric doesn't follow it: it spans the furrow, from
tangent point to tangent point, and presses on nothing in between. So the perimeter and the
curvature are those of the contour's convex hull, and the skin off the hull bears no pressure.
A flat part has no curvature and no pressure. Corners are rounded over the fabric's
``bending_length``, on the skin that bears: whatever the leg's shape, the pressure around a level
sums to :math:`2 \pi T`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry.polygon import orient

from legfem.common.checks import check_positive
from legfem.common.errors import InputError
from legfem.common.units import FloatArray, frozen_array
from legfem.geometry.leg_shape import SKIN, LegShape


@dataclass(frozen=True, eq=False)
class Stocking:
    """A knitted tube.

    Parameters
    ----------
    stiffness : float
        Tension per unit of strain around the leg (N/mm).
    levels : (n,) array
        Increasing heights (mm) in the leg's coordinates; one is enough for a straight tube.
    unstretched : (n,) array
        Perimeter of the unstretched fabric that is worn at these heights (mm).
    bending_length : float
        Over which the fabric rounds corners of the leg (mm).

    Raises
    ------
    InputError
        For a value that isn't positive, or levels that do not increase.
    """

    stiffness: float
    levels: FloatArray
    unstretched: FloatArray
    bending_length: float = 15.0

    def __post_init__(self) -> None:
        """Copy and check the values."""
        check_positive(self, "stiffness", "bending_length")
        for name in ("levels", "unstretched"):
            object.__setattr__(self, name, frozen_array(np.atleast_1d(getattr(self, name))))
        if self.levels.shape != self.unstretched.shape or not (np.diff(self.levels) > 0).all():
            raise InputError(
                "stocking", "levels",
                f"{len(self.levels)} levels and {len(self.unstretched)} perimeters",
                "give as many of both, the levels increasing",
            )  # fmt: skip
        if not (np.isfinite(self.unstretched).all() and (self.unstretched > 0).all()):
            raise InputError(
                "stocking", "unstretched", "a perimeter is not positive", "give perimeters in mm"
            )

    def strain(self, perimeter: FloatArray, levels: FloatArray) -> FloatArray:
        """Return the fabric's strain at heights of a leg with given perimeters (mm).

        It is negative where the fabric is wider than the leg and slack.
        """
        return perimeter / np.interp(levels, self.levels, self.unstretched) - 1

    def tension(self, strain: FloatArray) -> FloatArray:
        """Return the tension (N/mm) by the strain; a slack fabric has none."""
        return self.stiffness * np.maximum(strain, 0.0)


@dataclass(frozen=True, eq=False)
class StockingLoad:
    """What a stocking does to a leg of given shape; all at the shape's levels.

    Parameters
    ----------
    perimeter : (n_levels,) array
        Spanned by the fabric (mm).
    strain : (n_levels,) array
        Of the fabric, negative where it is slack.
    tension : (n_levels,) array
        N/mm.
    curvature : (n_levels, n_points) array
        At the skin's points (1/mm), zero off the hull.
    pressure : (n_levels, n_points) array
        MPa.
    """

    perimeter: FloatArray
    strain: FloatArray
    tension: FloatArray
    curvature: FloatArray
    pressure: FloatArray

    def times(self, factor: float) -> StockingLoad:
        """Return the load of a fabric under a tension by so much greater."""
        return replace(
            self, tension=factor * self.tension, pressure=factor * self.pressure
        )  # fmt: skip

    @property
    def mean_pressure(self) -> float:
        """Over the skin, whose points are evenly spaced around each level (MPa)."""
        return float(np.average(self.pressure.mean(axis=1), weights=self.perimeter))


def stocking_load(shape: LegShape, stocking: Stocking) -> StockingLoad:
    """Return the load of a stocking on the skin of a leg, of its shape under compression.

    Raises
    ------
    InputError
        If the stocking is slack at every level of the leg.
    """
    perimeter = np.empty(len(shape.levels))
    curvature = np.empty(shape.contours[SKIN].shape[:2])
    for number, contour in enumerate(shape.contours[SKIN]):
        perimeter[number], curvature[number] = _spanned(contour, stocking.bending_length)
    strain = stocking.strain(perimeter, shape.levels)
    tension = stocking.tension(strain)
    if (tension == 0).all():
        raise InputError(
            "stocking", "unstretched",
            f"the stocking (narrowest {stocking.unstretched.min():g} mm) is wider than the leg "
            f"(widest {perimeter.max():g} mm) everywhere",
            "give the fabric's unstretched perimeters (not diameters or widths) in mm",
        )  # fmt: skip
    return StockingLoad(perimeter, strain, tension, curvature, tension[:, None] * curvature)


def _spanned(contour: FloatArray, span: float) -> tuple[float, FloatArray]:
    """Return the hull's perimeter and its curvature at a contour's points, (n,)."""
    hull = shapely.convex_hull(shapely.MultiPoint(contour))
    ring = shapely.get_coordinates(orient(hull).exterior)[:-1]
    sides = np.roll(ring, -1, axis=0) - ring
    length = np.linalg.norm(sides, axis=1)
    perimeter = float(length.sum())
    heading = np.arctan2(sides[:, 1], sides[:, 0])
    turn = np.mod(heading - np.roll(heading, 1), 2 * np.pi)
    corner = np.concatenate([[0.0], np.cumsum(length)[:-1]])
    at, distance = _along(ring, contour)
    # Each corner's turn is spread over the span by a raised cosine, where the fabric bears.
    offset = np.abs(at[:, None] - corner)
    offset = np.minimum(offset, perimeter - offset)
    cosine = np.where(offset < span, 1 + np.cos(np.pi * offset / span), 0.0)
    bearing = np.where(distance < OFF, 0.5 * (1 + np.cos(np.pi * distance / OFF)), 0.0)
    spread = bearing[:, None] * cosine
    around = np.linalg.norm(np.roll(contour, -1, axis=0) - np.roll(contour, 1, axis=0), axis=1) / 2
    return perimeter, (spread / (around @ spread)) @ turn


OFF = 0.4
"""Distance (mm) off the hull over which the fabric ceases to bear on the skin."""


def _along(ring: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where points project on a closed ring (mm along it), and their distance."""
    line = shapely.LinearRing(ring)
    given = shapely.points(points)
    return shapely.line_locate_point(line, given), shapely.distance(line, given)

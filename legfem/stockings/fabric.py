r"""The fabric of a stocking: its pressure by Laplace's law, and the size that a compression class takes.

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

Classes are those of RAL-GZ 387/1 (Medical Compression Hosiery, Quality Assurance, 2008), by the
pressure at the ankle in mmHg. Upwards the pressure falls; below the knee the standard allows at
most 70 % of the ankle's.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from legfem.common.errors import AboveZero, Checked, InputError
from legfem.common.resources import resource
from legfem.common.units import FloatArray, frozen_array, mmhg_to_mpa
from legfem.geometry.leg_shape import SKIN, LegShape


@dataclass(frozen=True, eq=False)
class Stocking(Checked):
    """A knitted tube.

    Parameters
    ----------
    stiffness : float
        Tension per unit of strain around the leg (N/mm).
    levels : (n,) array
        Increasing heights (mm) in the leg's coordinates; one is enough for a straight tube.
    unstretched : (n,) array
        Unstretched perimeters of the fabric that is worn at these heights (mm).
    bending_length : float
        Length over which the fabric rounds corners of the leg (mm).

    Raises
    ------
    InputError
        For a value that isn't positive, or levels that do not increase.
    """

    stiffness: AboveZero[float]
    levels: FloatArray
    unstretched: FloatArray
    bending_length: AboveZero[float] = 15.0

    def __post_init__(self) -> None:
        """Copy and check the values."""
        super().__post_init__()
        for name in ("levels", "unstretched"):
            object.__setattr__(self, name, frozen_array(np.atleast_1d(getattr(self, name))))
        if self.levels.shape != self.unstretched.shape:
            problem = f"{len(self.levels)} levels and {len(self.unstretched)} perimeters"
            raise InputError("stocking", "levels", problem, "give as many of both")
        steps = np.diff(self.levels)
        if not (steps > 0).all():
            at = float(self.levels[1:][steps <= 0][0])
            problem = f"the level {at:g} mm is given twice, or after a greater one"
            raise InputError("stocking", "levels", problem, "give each level once, in increasing order")
        if not (np.isfinite(self.unstretched).all() and (self.unstretched > 0).all()):
            raise InputError("stocking", "unstretched", "a perimeter is not positive", "give perimeters in mm")

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
    """Load of a stocking on a leg of given shape, at the shape's levels.

    Parameters
    ----------
    perimeter : (n_levels,) array
        Perimeter that the fabric spans (mm).
    strain : (n_levels,) array
        Strain of the fabric, negative where it is slack.
    tension : (n_levels,) array
        Tension of the fabric, N per mm of height.
    curvature : (n_levels, n_points) array
        Curvature at the skin's points (1/mm), zero off the convex hull.
    pressure : (n_levels, n_points) array
        Pressure at the skin's points, MPa.
    """

    perimeter: FloatArray
    strain: FloatArray
    tension: FloatArray
    curvature: FloatArray
    pressure: FloatArray

    def times(self, factor: float) -> "StockingLoad":
        """Scale tension and pressure by a factor."""
        return replace(self, tension=factor * self.tension, pressure=factor * self.pressure)

    @property
    def mean_pressure(self) -> float:
        """Mean over the skin, whose points are evenly spaced around each level (MPa)."""
        return float(np.average(self.pressure.mean(axis=1), weights=self.perimeter))

    @property
    def unloaded_skin(self) -> FloatArray:
        """Share of each level's skin that bears no pressure, (n_levels,).

        The stretched fabric spans a hollow or a flat there; at levels where it is slack the share is 0.
        """
        share = (self.pressure < 1e-3 * self.pressure.max()).mean(axis=1)
        return np.where(self.tension > 0, share, 0.0)


def stocking_load(shape: LegShape, stocking: Stocking) -> StockingLoad:
    """Apply Laplace's law to the shape of a leg as it is compressed.

    Raises
    ------
    InputError
        If the stocking is slack at every level of the leg.
    """
    perimeter, curvature = _spanned(shape.contours[SKIN], stocking.bending_length)
    strain = stocking.strain(perimeter, shape.levels)
    tension = stocking.tension(strain)
    if (tension == 0).all():
        problem = f"the stocking (narrowest {stocking.unstretched.min():g} mm) is wider than the leg "
        problem += f"(widest {perimeter.max():g} mm) everywhere"
        remedy = "give the fabric's unstretched perimeters (not diameters or widths) in mm"
        raise InputError("stocking", "unstretched", problem, remedy)
    return StockingLoad(perimeter, strain, tension, curvature, tension[:, None] * curvature)


def _spanned(contours: FloatArray, span: float) -> tuple[FloatArray, FloatArray]:
    """Return the hulls' perimeters (n_levels,), and their curvature at the contours' points.

    Parameters
    ----------
    contours : (n_levels, n_points, 2) array
        Counter-clockwise (mm).
    span : float
        Length over which a corner's turn is spread to either side (mm).
    """
    corners = np.zeros(contours.shape[:2], dtype=bool)
    for on_hull, contour in zip(corners, contours, strict=True):
        on_hull[ConvexHull(contour).vertices] = True
    behind, ahead = _neighbours(corners)
    first = np.take_along_axis(contours, behind[..., None], axis=1)
    side = np.take_along_axis(contours, ahead[..., None], axis=1) - first
    length = np.linalg.norm(side, axis=2)
    own = np.where(corners, length, 0.0)
    perimeter = own.sum(axis=1)
    place = np.cumsum(own, axis=1) - own
    # A point off the hull projects on the side that spans the furrow.
    share = np.clip(np.sum((contours - first) * side, axis=2) / length**2, 0.0, 1.0)
    distance = np.linalg.norm(contours - first - share[..., None] * side, axis=2)
    at = np.take_along_axis(place, behind, axis=1) + share * length
    heading = np.arctan2(side[..., 1], side[..., 0])
    before = np.take_along_axis(heading, np.roll(behind, 1, axis=1), axis=1)
    turn = np.where(corners, np.mod(heading - before + np.pi, 2 * np.pi) - np.pi, 0.0)
    bearing = np.where(distance < OFF, 0.5 * (1 + np.cos(np.pi * distance / OFF)), 0.0)
    around = np.roll(contours, -1, axis=1) - np.roll(contours, 1, axis=1)
    around = 0.5 * np.linalg.norm(around, axis=2)
    # Each corner's turn is spread over the span by a raised cosine, where the fabric bears: on the
    # points so and so many places further on.
    spread = {}
    for shift, offset in _offsets(at, place, perimeter[:, None], span):
        cosine = np.where(offset < span, 1 + np.cos(np.pi * offset / span), 0.0)
        spread[shift] = np.roll(bearing, -shift, axis=1) * cosine
    total = sum(np.roll(around, -shift, axis=1) * share for shift, share in spread.items())
    weight = np.divide(turn, total, out=np.zeros_like(turn), where=corners)
    curvature = sum(np.roll(share * weight, shift, axis=1) for shift, share in spread.items())
    return perimeter, np.asarray(curvature)


def _offsets(at: FloatArray, place: FloatArray, perimeter: FloatArray, span: float) -> Iterator[tuple[int, FloatArray]]:
    """Yield how far points lie from the corners so many places before them, up to the span."""
    count = at.shape[1]
    for shifts in (range(count // 2 + 1), range(-1, -((count + 1) // 2), -1)):
        for shift in shifts:
            offset = np.abs(np.roll(at, -shift, axis=1) - place)
            offset = np.minimum(offset, perimeter - offset)
            if (offset >= span).all():
                break
            yield shift, offset


OFF = 0.4
"""Distance (mm) off the hull over which the fabric ceases to bear on the skin."""


def _neighbours(corners: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return for every point the corner at or before it, and the next; (n_levels, n_points).

    Points go round, so that the first ones' corner may be the last.
    """
    count = corners.shape[1]
    number = np.arange(count)
    behind = np.maximum.accumulate(np.where(corners, number, -1), axis=1)
    behind = np.where(behind < 0, behind[:, -1:], behind)
    at_or_after = np.minimum.accumulate(np.where(corners, number, count)[:, ::-1], axis=1)[:, ::-1]
    at_or_after = np.where(at_or_after == count, at_or_after[:, :1], at_or_after)
    return behind, np.roll(at_or_after, -1, axis=1)


CALF_SHARE = 0.7
"""Pressure at the calf over that at the ankle."""


type CompressionClass = Literal["1", "2", "3", "4"]
"""A class of RAL-GZ 387/1: light, moderate, strong and very strong."""
type Standard = Literal["RAL-GZ 387", "ENV 12718", "NF G 30-102 B"]
ANKLE_LIMITS = resource("stockings", dict[Standard, dict[str, tuple[float, float]]])
"""Pressure at B by class, mmHg."""


def fitted_stocking(shape: LegShape, chosen: CompressionClass, stiffness: float = 0.3) -> Stocking:
    r"""Return the stocking whose mean pressure on a bare leg is a class's on the calf, at every height.

    At a height with the perimeter L that the fabric spans, the mean pressure is
    :math:`2 \pi T / L`.

    Parameters
    ----------
    shape
        The bare leg.
    chosen
        Class, whose middle pressure at the ankle counts, times `CALF_SHARE`.
    stiffness
        Stiffness of the fabric (N/mm per unit of strain).

    Raises
    ------
    InputError
        If the fabric would have to be stretched more than threefold.
    """
    probe = Stocking(1.0, shape.levels[:1], np.array([1.0]))
    perimeter = stocking_load(shape, probe).perimeter
    least, most = ANKLE_LIMITS["RAL-GZ 387"][chosen]
    # Of 49 mmHg and more the lower bound is taken.
    pressure = CALF_SHARE * mmhg_to_mpa(0.5 * (least + (most if np.isfinite(most) else least)))
    strain = pressure * perimeter / (2 * np.pi) / stiffness
    if strain.max() > 2:
        problem = f"at {stiffness:g} N/mm the fabric is stretched by {100 * strain.max():.0f} %"
        remedy = "give a stiffer fabric, in N/mm of tension per unit of strain"
        raise InputError("stocking", "stiffness_N_per_mm", problem, remedy)
    return Stocking(stiffness, shape.levels, perimeter / (1 + strain))

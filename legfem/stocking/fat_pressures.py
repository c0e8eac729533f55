"""Thickness of the fat round the leg, and the pressures over it and in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.stats import spearmanr

from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import HULL, SKIN, LegShape
from legfem.stocking.pressures import END_ZONE, PressureProbe
from legfem.stocking.worn import Worn

AROUND, DEPTHS = 60, np.linspace(0.06, 0.94, 9)
"""Columns of fat at a level, and where in them the pressure is taken: shares of the thickness."""

_BY_MESH = ((16_679, 3.661), (61_606, 3.825), (191_506, 4.078), (496_489, 4.223))
"""Tetrahedra, and the greatest pressure in the fat (kPa) of one state of leg 1
(`python -m studies.stockings sizes`)."""


def too_low_by(tetrahedra: int) -> tuple[float, float]:
    """Return by which shares the greatest pressure in the fat is too low on a mesh, (least, most).

    It sits in a few elements. Measured on leg 1: against its finest mesh, and against what the last
    two extrapolate to with the edges' length.
    """
    edges, pressures = np.array([(count ** (-1 / 3), pressure) for count, pressure in _BY_MESH]).T
    slope = (pressures[-2] - pressures[-1]) / (edges[-2] - edges[-1])
    limit = pressures[-1] - slope * edges[-1]
    # Coarser than all of them counts as the coarsest.
    here = np.interp(tetrahedra ** (-1 / 3), [0.0, *edges[::-1]], [limit, *pressures[::-1]])
    return max(0.0, float(1 - here / pressures[-1])), float(1 - here / limit)


@dataclass(frozen=True, eq=False)
class FatPressures:
    """Columns of fat, from the skin straight to the hull, all round the leg; pressures in MPa.

    Parameters
    ----------
    levels : (n_levels,) array
        Of the bare leg (mm), the segment's ends left out.
    skin : (n_levels, n_columns, 2) array
        Where the columns begin (mm).
    thickness : (n_levels, n_columns) array
        Of the bare leg's fat, horizontally (mm).
    interface : (n_levels, n_columns) array
        On the skin.
    greatest, mean : (n_levels, n_columns) array
        Hydrostatic, in the column.
    """

    levels: FloatArray
    skin: FloatArray
    thickness: FloatArray
    interface: FloatArray
    greatest: FloatArray
    mean: FloatArray

    def rank_correlation(self, what: FloatArray, by: FloatArray) -> float:
        """Return Spearman's rank correlation of two of the arrays over all columns.

        NaN where one of them is the same everywhere, as on a round leg.
        """
        if np.nanmax(by) == np.nanmin(by) or np.nanmax(what) == np.nanmin(what):
            return np.nan
        return float(spearmanr(by.ravel(), what.ravel(), nan_policy="omit").statistic)


def fat_pressures(shape: LegShape, worn: Worn, probe: PressureProbe) -> FatPressures:
    """Return the fat's thickness and pressures in a worn state; all ranks call."""
    inside = (shape.levels >= shape.levels[0] + END_ZONE) & (shape.levels <= shape.levels[-1] - END_ZONE)
    step = max(1, shape.contours[SKIN].shape[1] // AROUND)
    skin = shape.contours[SKIN][inside, ::step]
    foot = np.stack(
        [_nearest(contour, points) for contour, points in zip(shape.contours[HULL][inside], skin, strict=True)]
    )
    columns = skin[..., None, :] + DEPTHS[:, None] * (foot - skin)[..., None, :]
    z = np.broadcast_to(shape.levels[inside, None, None, None], (*columns.shape[:3], 1))
    points = np.concatenate([columns, z], axis=-1)
    values = probe.at(points.reshape(-1, 3), worn.state).reshape(points.shape[:3])
    found = np.ma.masked_invalid(values)
    return FatPressures(
        shape.levels[inside],
        skin,
        np.linalg.norm(foot - skin, axis=-1),
        worn.load.pressure[inside, ::step],
        found.max(axis=2).filled(np.nan),
        found.mean(axis=2).filled(np.nan),
    )


def _nearest(contour: FloatArray, points: FloatArray) -> FloatArray:
    """Return the points of a closed contour nearest to others, (n, 2)."""
    ring = shapely.LinearRing(contour)
    along = shapely.line_locate_point(ring, shapely.points(points))
    return np.asarray(shapely.get_coordinates(shapely.line_interpolate_point(ring, along)))

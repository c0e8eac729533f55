"""What else moves the contours: the scans' places, errors of the pressure and of the bare outlines.

None is known exactly. All go into the fit as parameters with a prior, so that the stiffnesses'
intervals carry them: RIGID motions, the pressure in SECTORS, then the modes of the outlines' errors
(`legfem.stocking.outline_errors`). Where the fabric isn't taken as it was given, the last is the
share by which its tension errs.
"""

from __future__ import annotations

import numpy as np

from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import SKIN, LegShape
from legfem.stocking.misfit import ContourMisfit

RIGID, SECTORS = 6, 8
"""Motions of a scan; parts of the leg's girth in which the pressure errs alike."""


def nuisance_sd(misfit: ContourMisfit) -> FloatArray:
    """Return the standard deviations of motions (mm, rad) and pressure, (RIGID + SECTORS,)."""
    return np.concatenate([misfit.rigid_sd, np.full(SECTORS, misfit.accuracy.pressure_sd)])


def sectors(shape: LegShape) -> list[FloatArray]:
    """Return bumps round the leg that sum to one, each (n_levels, n_points)."""
    width = 2 * np.pi / SECTORS
    bumps = []
    for number in range(SECTORS):
        away = from_sector(shape.contours[SKIN], number)
        bumps.append(np.where(away < width, 0.5 * (1 + np.cos(np.pi * away / width)), 0.0))
    return bumps


def from_sector(contours: FloatArray, number: int) -> FloatArray:
    """Return the angle (rad) of points from a sector's middle, about their contours' middle.

    Parameters
    ----------
    contours : (n_levels, n_points, 2) array
        mm.
    number : int
        Of the sector, counter-clockwise from +x.
    """
    offset = contours - contours.mean(axis=1, keepdims=True)
    angle = np.arctan2(offset[..., 1], offset[..., 0])
    away: FloatArray = np.abs(np.mod(angle - 2 * np.pi * number / SECTORS + np.pi, 2 * np.pi))
    return np.abs(away - np.pi)

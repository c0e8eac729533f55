"""What else moves the contours: the scans' places, and errors of the pressure round the leg.

Neither is known exactly. Both go into the fit as parameters with a prior, so that the stiffnesses'
intervals carry them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from legfem.experiments.compression import Compressed
from legfem.geometry.leg_shape import SKIN, LegShape
from legfem.stocking.leg_model import LegModel3D
from legfem.stocking.misfit import ContourMisfit
from legfem.units import FloatArray

RIGID, SECTORS = 6, 8
"""Motions of a scan; parts of the leg's girth in which the pressure errs alike."""
STEP = 1e-2
"""Greatest displacement (mm) of a difference."""


@dataclass(frozen=True, eq=False)
class Nuisances:
    """Slopes of the distances by shifts (mm), turns (rad) and the pressure's relative errors.

    Parameters
    ----------
    slopes : (n, 14) array
        The six rigid motions first.
    sd : (14,) array
        Of the priors.
    """

    slopes: FloatArray
    sd: FloatArray


def nuisances(
    model: LegModel3D, pressure: FloatArray, misfit: ContourMisfit, state: Compressed
) -> Nuisances:
    """Return the nuisances' slopes at the state last solved for."""
    rigid = misfit.rigid_slopes(model.deformed_shape(state.unknown))
    bumps = sectors(model.shape)
    rates = model.pressure_rates(state, [pressure * bump for bump in bumps])
    local = [distance_slope(model, misfit, state, rate) for rate in rates]
    sd = np.concatenate([misfit.rigid_sd, np.full(SECTORS, misfit.accuracy.pressure_sd)])
    return Nuisances(np.column_stack([rigid, *local]), sd)


def distance_slope(
    model: LegModel3D, misfit: ContourMisfit, state: Compressed, rate: FloatArray
) -> FloatArray:
    """Return the distances' slope along a derivative of the unknown, (n,)."""
    step = STEP / max(float(np.abs(model.displacement(SKIN, rate)).max()), 1e-12)
    here, ahead = (
        misfit.distances(model.deformed_shape(state.unknown + s * rate)) for s in (0.0, step)
    )
    return (ahead - here) / step


def sectors(shape: LegShape) -> list[FloatArray]:
    """Return bumps round the leg that sum to one, each (n_levels, n_points)."""
    skin = shape.contours[SKIN]
    offset = skin - skin.mean(axis=1, keepdims=True)
    angle = np.arctan2(offset[..., 1], offset[..., 0])
    width = 2 * np.pi / SECTORS
    bumps = []
    for k in range(SECTORS):
        away = np.abs(np.mod(angle - k * width + np.pi, 2 * np.pi) - np.pi)
        bumps.append(np.where(away < width, 0.5 * (1 + np.cos(np.pi * away / width)), 0.0))
    return bumps

"""Hydrostatic pressure in a section of a worn leg."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import SKIN, LegShape
from legfem.stocking.pressures import PressureProbe
from legfem.stocking.worn import Worn

SPACING = 0.5
"""Of the points (mm)."""


@dataclass(frozen=True, eq=False)
class SectionPressures:
    """Pressure on a grid of the bare leg's points at one level.

    Parameters
    ----------
    level : float
        mm.
    x : (n,) array
        mm.
    y : (m,) array
        mm.
    pressure : (m, n) array
        MPa; NaN outside the tissues.
    """

    level: float
    x: FloatArray
    y: FloatArray
    pressure: FloatArray


def section_pressures(shape: LegShape, level: float, worn: Worn, probe: PressureProbe) -> SectionPressures:
    """Return the pressure at a level of the bare leg; all ranks call."""
    outline = shape.at(SKIN, level)
    x, y = (
        np.arange(low - 1.0, high + 1.0, SPACING)
        for low, high in zip(outline.min(axis=0), outline.max(axis=0), strict=True)
    )
    points = np.stack([*np.meshgrid(x, y), np.full((len(y), len(x)), level)], axis=-1)
    values = probe.at(points.reshape(-1, 3), worn.state).reshape(len(y), len(x))
    return SectionPressures(level, x, y, values)

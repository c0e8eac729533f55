"""Heights at which makers give a stocking's pressure (B, B1, C, D), and what a class asks for there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from legfem.common.units import FloatArray, mpa_to_mmhg
from legfem.geometry.leg_shape import LegShape, perimeter
from legfem.stockings.fabric import ANKLE_MMHG, StockingLoad
from legfem.stockings.misfit import ContourAccuracy

type Level = Literal["B", "B1", "C", "D"]
type Standard = Literal["RAL-GZ 387", "ENV 12718"]
PLACES: Mapping[Level, str] = {
    "B": "least girth above the ankle",
    "B1": "where the Achilles tendon passes into the calf's muscles",
    "C": "greatest girth of the calf",
    "D": "below the head of the fibula",
}
_RAL: Mapping[str, tuple[float, float]] = {str(name): ends for name, ends in ANKLE_MMHG.items()} | {
    "4": (49.0, float("inf"))
}
ANKLE_LIMITS: Mapping[Standard, Mapping[str, tuple[float, float]]] = {
    "RAL-GZ 387": _RAL,
    "ENV 12718": {**_RAL, "A": (10.0, 14.0), "1": (15.0, 21.0)},
}
"""Pressure at B by class, mmHg."""
MESH_SHARE = 0.1
"""Error of the mesh over the change of pressure that the leg's giving way makes: a judgement, not measured."""
_AROUND = 8
"""Parts of the girth whose pressures err by themselves."""


@dataclass(frozen=True)
class MakersLevels:
    """What a maker states.

    Parameters
    ----------
    standard, intended_class : str
        Whose limits the pressures are set beside; no class for none.
    heights : mapping
        Of levels in the scan (mm); B and C are looked for by the girth where they aren't stated.
    shares : mapping
        Least and greatest pressure over that at B, in per cent, by level.
    """

    standard: Standard = "RAL-GZ 387"
    intended_class: str = ""
    heights: Mapping[Level, float] = field(default_factory=dict)
    shares: Mapping[Level, tuple[float, float]] = field(default_factory=dict)
    assumed_fabric: bool = False
    """Whether the fabric was chosen to have a class's pressure, and is no real stocking's."""

    def limits(self, level: Level, ankle: float | None) -> tuple[float, float] | None:
        """Return the least and greatest pressure at a level (mmHg), given that at B; None without any."""
        if level == "B":
            return ANKLE_LIMITS[self.standard].get(self.intended_class)
        if level not in self.shares or ankle is None:
            return None
        low, high = self.shares[level]
        return 0.01 * low * ankle, 0.01 * high * ankle

    def found(self, shape: LegShape) -> dict[Level, tuple[float, bool]]:
        """Return heights of levels within a leg (mm), and whether they were stated."""
        levels, around = shape.levels, perimeter(shape)
        heights = {name: (height, True) for name, height in self.heights.items()}
        widest = int(np.argmax(around))
        if 0 < widest < len(levels) - 1:
            heights.setdefault("C", (float(levels[widest]), False))
        narrow = [k for k in range(1, widest) if around[k] <= min(around[k - 1], around[k + 1])]
        if narrow:
            heights.setdefault("B", (float(levels[min(narrow, key=lambda k: around[k])]), False))
        order: tuple[Level, ...] = ("B", "B1", "C", "D")
        return {
            name: heights[name] for name in order if name in heights and levels[0] <= heights[name][0] <= levels[-1]
        }


@dataclass(frozen=True, eq=False)
class PressureAlong:
    """Mean pressure round the leg by its height, with its standard deviation; mmHg."""

    levels: FloatArray
    mean: FloatArray
    least: FloatArray
    greatest: FloatArray
    sd: FloatArray

    @classmethod
    def of(cls, bare: LegShape, load: StockingLoad, on_bare: StockingLoad, accuracy: ContourAccuracy) -> PressureAlong:
        """Return the pressures of a load on a leg, beside that on the leg if it didn't give way.

        They err by the fabric's tension, alike at all heights, by its scatter round the leg, and by the mesh.
        """
        mean, stiff = (mpa_to_mmhg(one.pressure.mean(axis=1)) for one in (load, on_bare))
        fabric = mean * np.hypot(accuracy.tension_sd, accuracy.pressure_sd / np.sqrt(_AROUND))
        mesh = MESH_SHARE * np.abs(mean - stiff)
        extreme = mpa_to_mmhg(load.pressure)
        return cls(bare.levels, mean, extreme.min(axis=1), extreme.max(axis=1), np.hypot(fabric, mesh))

    def at(self, height: float) -> tuple[float, float]:
        """Return the pressure and its standard deviation at a height (mm)."""
        return float(np.interp(height, self.levels, self.mean)), float(np.interp(height, self.levels, self.sd))


NOTHING_STATED = MakersLevels()
"""Of a maker."""

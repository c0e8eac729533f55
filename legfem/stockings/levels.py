"""The pressure along a leg, and at the levels at which makers give it, beside the limits of a class."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal, get_args

import numpy as np

from legfem.common.units import FloatArray, mpa_to_mmhg
from legfem.geometry.leg_shape import LegShape, perimeter
from legfem.inverse.intervals import quantile
from legfem.stockings.contour_distances import ContourAccuracy
from legfem.stockings.fabric import ANKLE_LIMITS, Standard, StockingLoad

TISSUES: Mapping[str, str] = {"deep.C10": "muscle", "superficial.C10": "fat"}
"""What people call the tissues whose stiffness is fitted."""
type Level = Literal["B", "B1", "C", "D"]
LEVELS: tuple[Level, ...] = get_args(Level.__value__)
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
        return {
            name: heights[name] for name in LEVELS if name in heights and levels[0] <= heights[name][0] <= levels[-1]
        }


@dataclass(frozen=True, eq=False)
class PressureAlong:
    """Mean pressure round the leg by its height, with its standard deviation; mmHg."""

    levels: FloatArray
    mean: FloatArray
    least: FloatArray
    greatest: FloatArray
    sd: FloatArray
    on_bare: FloatArray
    """Mean if the leg didn't give way."""

    @classmethod
    def of(
        cls, bare: LegShape, load: StockingLoad, on_bare: StockingLoad, accuracy: ContourAccuracy
    ) -> "PressureAlong":
        """Return the pressures of a load on a leg, beside that on the leg if it didn't give way.

        They err by the fabric's tension, alike at all heights, by its scatter round the leg, and by the mesh.
        """
        mean, stiff = (mpa_to_mmhg(one.pressure.mean(axis=1)) for one in (load, on_bare))
        fabric = mean * np.hypot(accuracy.tension_sd, accuracy.pressure_sd / np.sqrt(_AROUND))
        mesh = MESH_SHARE * np.abs(mean - stiff)
        extreme = mpa_to_mmhg(load.pressure)
        return cls(bare.levels, mean, extreme.min(axis=1), extreme.max(axis=1), np.hypot(fabric, mesh), stiff)

    def at(self, height: float) -> tuple[float, float]:
        """Return the pressure and its standard deviation at a height (mm)."""
        return float(np.interp(height, self.levels, self.mean)), float(np.interp(height, self.levels, self.sd))


NOTHING_STATED = MakersLevels()
"""A maker who states nothing."""


@dataclass(frozen=True)
class LevelPressure:
    """Mean pressure round the leg at one level, by the names of ``result.json``.

    Attributes
    ----------
    level : str
        As makers call it.
    height_mm : float
    height_is_stated : bool
    mean_pressure_mmHg : float
    ci95_mmHg : (float, float)
        95 % interval of that.
    over_pressure_at_B : float, optional
    limits_mmHg : (float, float), optional
        Of the class, or stated.
    """

    level: Level
    height_mm: float
    height_is_stated: bool
    mean_pressure_mmHg: float
    ci95_mmHg: tuple[float, float]
    over_pressure_at_B: float | None
    limits_mmHg: tuple[float, float] | None

    @property
    def verdict(self) -> Literal["within", "too low", "too high", "not certain", "no limits"]:
        """Where the interval lies beside the limits."""
        if self.limits_mmHg is None:
            return "no limits"
        (low, high), (least, most) = self.ci95_mmHg, self.limits_mmHg
        if least <= low and high <= most:
            return "within"
        if high < least:
            return "too low"
        return "too high" if low > most else "not certain"


def rises(levels: Sequence[LevelPressure]) -> list[tuple[LevelPressure, LevelPressure]]:
    """Return the levels next to each other of which the upper has the higher pressure, or the same.

    A stocking's pressure is to decrease steadily from the ankle upwards: so says the Gütezeichengemeinschaft
    Medizinische Kompressionsstrümpfe, which publishes RAL-GZ 387, on https://www.gzg-kompressionsstruempfe.de.
    """
    upwards = sorted(levels, key=lambda one: one.height_mm)
    return [(low, up) for low, up in pairwise(upwards) if up.mean_pressure_mmHg >= low.mean_pressure_mmHg]


def pressures_at_levels(along: PressureAlong, makers: MakersLevels, bare: LegShape) -> Iterator[LevelPressure]:
    """Yield the pressure at each of the makers' levels that a leg has."""
    places = makers.found(bare)
    # A slack fabric presses with nothing, of which no other pressure is a share.
    ankle = along.at(places["B"][0])[0] or None if "B" in places else None
    for name, (height, stated) in places.items():
        mean, sd = along.at(height)
        half = quantile(0) * sd
        share = None if ankle is None else mean / ankle
        limits = makers.limits(name, ankle)
        yield LevelPressure(name, height, stated, mean, (mean - half, mean + half), share, limits)


@dataclass(frozen=True)
class FabricFor:
    """Fabric under which the mean pressure at B is within a class's limits, by the names of ``result.json``.

    Attributes
    ----------
    compression_class : str
    limits_mmHg : (float, float)
    tension_factor : (float, float)
        Over the tension, and the stiffness at this size, of the fabric as it is; infinite where none comes so far.
    stiffness_N_per_mm : (float, float)
        That is, of a fabric of the same size.
    unstretched_mm_at_B : (float, float)
        Perimeters of a fabric of the same stiffness.
    """

    compression_class: str
    limits_mmHg: tuple[float, float]
    tension_factor: tuple[float, float]
    stiffness_N_per_mm: tuple[float, float]
    unstretched_mm_at_B: tuple[float, float]


WAYS = {"stiffness_N_per_mm": ("stiffness", "N/mm"), "unstretched_mm_at_B": ("unstretched girth at B", "mm")}
"""What a fabric is chosen by, what people call it, and its unit."""


def fabrics_for_classes(
    along: PressureAlong, load: StockingLoad, makers: MakersLevels, bare: LegShape
) -> Iterator[FabricFor]:
    r"""Yield the fabric for each class of a standard, where the leg has a level B.

    By Laplace's law a leg that doesn't give way has :math:`p_0` under the fabric. It has :math:`p`, and gives way in
    proportion to that, so that s times the tension makes :math:`s p_0 / (1 + s p_0 (1/p - 1/p_0))` of it.
    """
    height = makers.found(bare).get("B", (math.nan, False))[0]
    pressure, on_bare, strain, girth, tension = (
        float(np.interp(height, along.levels, one))
        for one in (along.mean, along.on_bare, load.strain, load.perimeter, load.tension)
    )
    if not pressure > 0:
        return
    for name, (least, most) in ANKLE_LIMITS[makers.standard].items():
        left = (1 / wanted - (1 / pressure - 1 / on_bare) for wanted in (least, most))
        low, high = (1 / (on_bare * one) if one > 0 else math.inf for one in left)
        sizes = girth / (1 + high * strain), girth / (1 + low * strain)
        yield FabricFor(name, (least, most), (low, high), (low * tension / strain, high * tension / strain), sizes)


def fewest(spans: Sequence[tuple[float, float]]) -> Iterator[tuple[float, int]]:
    """Yield the fewest values of which one lies in each span, with the number of spans that each lies in.

    The first span to end decides on each: no fewer can serve those that end before the next one begins.
    """
    left = sorted(spans, key=lambda one: one[1])
    while left:
        value = left[0][1] if math.isfinite(left[0][1]) else max(low for low, _ in left)
        yield value, sum(low <= value <= high for low, high in spans)
        left = [(low, high) for low, high in left if low > value]

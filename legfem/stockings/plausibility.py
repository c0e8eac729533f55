"""Checks of a leg and its stocking: what is impossible (an error) and what is unlikely (a doubt)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from legfem.common.doubts import Doubt, PhysicalRange
from legfem.common.errors import InputError
from legfem.common.units import mpa_to_kpa, mpa_to_mmhg
from legfem.data import ranges
from legfem.geometry.leg_shape import LegShape, perimeter
from legfem.legs.elastography import doubts_about_elastography
from legfem.legs.plausibility import doubts_about_size
from legfem.stockings.fabric import Stocking, stocking_load

if TYPE_CHECKING:
    from legfem.stockings.leg import StockingLeg

STRETCH = PhysicalRange(
    "a stretch of the fabric", "%", (5.0, 150.0), (0.0, 300.0), "stockings are worn stretched by some 20 to 120 %"
)
PRESSURE = PhysicalRange(
    "a mean pressure of the stocking",
    "mmHg",
    (3.0, 80.0),
    (0.2, 300.0),
    "18 to 49 mmHg and more at the ankle: RAL-GZ 387/1",
    {"N/m": 1e-3, "N/cm": 0.1},
)
_THICKER, _THICKER_BY_FAR = 1.001, 1.005
"""Mean perimeter in the stocking over that without: a stocking makes a leg thinner."""
_BEYOND_MM = 10.0
"""Length beyond a table's end for which its last perimeter may stand without a word."""
LEAST_LENGTH_MM = 80.0
"""Length of the segment below which its end faces decide what is found in it. With ends held and free,
the pressures at the veins in mid-segment differ by 30 to 45 % at 40 mm, by 20 to 30 % at 80 mm and by
15 to 20 % at 120 mm (legs 1 and 4, class 2, 3 kPa in both tissues)."""


def doubts_about_leg(leg: StockingLeg, toml: Path) -> tuple[Doubt, ...]:
    """Return what is unlikely in a leg and its stocking.

    Raises
    ------
    InputError
        For what can't be; names file, field and remedy.
    """
    return tuple(
        [
            *_girth(leg, toml),
            *_length(leg, toml),
            *_tissues(leg, toml),
            *_compressed(leg, toml),
            *_stocking(leg.bare, leg.stocking, toml),
            *doubts_about_elastography(toml, leg.elastography),
        ]
    )


def check_scans_differ(bare: LegShape, compressed: LegShape, toml: Path) -> None:
    """Check that a leg's two scans, as they were read, aren't one scan given twice.

    Raises
    ------
    InputError
        If all their outlines agree to a micrometre, which no second scan does.
    """
    same = bare.levels.shape == compressed.levels.shape and all(
        part in compressed.contours
        and compressed.contours[part].shape == xy.shape
        and np.allclose(compressed.contours[part], xy, rtol=0.0, atol=1e-3)
        for part, xy in bare.contours.items()
    )
    if same:
        raise InputError(
            toml,
            "compressed",
            "is the same scan as [bare]",
            "give the scan of the leg in its stocking, or leave [compressed] out",
        )


def _girth(leg: StockingLeg, toml: Path) -> Iterator[Doubt]:
    around = perimeter(leg.bare)
    largest = int(np.argmax(around))
    tibia = leg.bare.contours["tibia"][largest]
    yield from doubts_about_size(toml, "bare", float(around[largest]), tibia)


def _length(leg: StockingLeg, toml: Path) -> Iterator[Doubt]:
    if leg.bare.length < LEAST_LENGTH_MM - 1e-6:
        yield Doubt(
            str(toml),
            "segment",
            f"is {leg.bare.length:.0f} mm long: what its end faces do decides the pressures and the stiffness",
            f"model {LEAST_LENGTH_MM:g} mm or more: give scans that share as much, and widen from_mm and to_mm",
        )


def _tissues(leg: StockingLeg, toml: Path) -> Iterator[Doubt]:
    for name, law in leg.tissues.items():
        yield from ranges.D1.doubts(toml, f"tissues.{name}.D1_per_MPa", float(law.D1))
        if leg.known:
            yield from ranges.C10[name].doubts(toml, f"tissues.{name}.C10_kPa", mpa_to_kpa(float(law.C10)))


def _compressed(leg: StockingLeg, toml: Path) -> Iterator[Doubt]:
    if leg.compressed is None:
        return
    ratio = float(np.mean(perimeter(leg.compressed) / perimeter(leg.bare)))
    if ratio <= _THICKER:
        return
    found = Doubt(
        str(toml),
        "compressed",
        f"the leg is {100 * (ratio - 1):.2g} % thicker in its stocking than without",
        "are the scans of [bare] and [compressed] exchanged?",
    )
    if ratio > _THICKER_BY_FAR:
        raise found.error()
    yield found


def _stocking(bare: LegShape, stocking: Stocking, toml: Path) -> Iterator[Doubt]:
    low, high = float(bare.levels[0]), float(bare.levels[-1])
    first, last = float(stocking.levels[0]), float(stocking.levels[-1])
    if len(stocking.levels) > 1:
        beyond = max(first - low, high - last)
        found = Doubt(
            str(toml),
            "stocking.unstretched",
            f"the table of {first:g} to {last:g} mm leaves {beyond:.0f} mm of the leg's {low:.4g} to {high:.4g} mm out",
            "give perimeters at the levels of the scan, in its coordinates and in mm, or restrict [segment]",
        )
        if last < low or first > high:
            raise found.error()
        if beyond > _BEYOND_MM:
            yield found
    load = stocking_load(bare, stocking)
    yield from STRETCH.doubts(
        toml,
        "stocking",
        100 * float(load.strain.max()),
        "check the unstretched perimeters (whole, in mm) and the leg's girth",
    )
    yield from PRESSURE.doubts(
        toml,
        "stocking.stiffness_N_per_mm",
        mpa_to_mmhg(load.mean_pressure),
        "give N per mm of height and unit of strain",
    )

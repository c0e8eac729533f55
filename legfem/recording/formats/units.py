"""Units that instruments write, and what they measure."""

from __future__ import annotations

from typing import Literal, NamedTuple

from legfem.common.units import MPA_PER_MMHG

Quantity = Literal["time", "displacement", "force", "pressure"]


class Unit(NamedTuple):
    """A unit as a multiple of legfem's own: s, mm, N, MPa; others measure something else."""

    quantity: Quantity | None
    factor: float


_G = 9.80665
_UNITS = {
    "time": {
        1.0: "s sec secs second seconds sek sekunde sekunden seconde secondes",
        1e-3: "ms msec",
        1e-6: "us µs",
        60.0: "min minute minutes minuten",
        3600.0: "h hr hour",
    },
    "displacement": {
        1.0: "mm millimeter millimeters millimetre",
        10.0: "cm",
        1000.0: "m meter metre",
        1e-3: "um µm micron microns",
        25.4: "in inch inches",
    },
    "force": {1.0: "n newton newtons", 1e-3: "mn", 1e3: "kn", _G: "kgf kp", 1e-3 * _G: "gf p", 4.4482216152605: "lbf"},
    "pressure": {
        1.0: "mpa",
        1e-3: "kpa",
        1e-4: "mbar hpa",
        0.1: "bar",
        1e-6: "pa",
        MPA_PER_MMHG: "mmhg torr",
        6.894757293168e-3: "psi",
    },
}
_OTHERS = """
% - v mv a ma c °c degc k hz deg ° rad mm/s mm/min m/s n/mm kn/mm gpa mm/mm nm
n.m n·m n/mm² n/mm2 cycles cycle count g kg lb strain
"""
_KNOWN = {
    name: Unit(quantity, factor)  # type: ignore[arg-type]
    for quantity, factors in _UNITS.items()
    for factor, names in factors.items()
    for name in names.split()
} | {name: Unit(None, 1.0) for name in _OTHERS.split()}
OWN: dict[Quantity, str] = {"time": "s", "displacement": "mm", "force": "N", "pressure": "kPa"}
"""legfem's unit of each quantity."""


def unit_named(name: str) -> Unit | None:
    """Return a unit by its name; None for one that isn't known.

    Capitals count in mN and MN only: nobody measures soft tissue in meganewtons, so the latter
    isn't known.
    """
    plain = name.strip().replace("μ", "µ")
    return None if plain == "MN" else _KNOWN.get(plain.lower())

"""Where the numbers of a leg and of its indentation usually lie, and where they can."""

import math
from collections.abc import Iterator
from pathlib import Path

from shapely import Polygon

from legfem.common.errors import Doubt, PhysicalRange
from legfem.common.resources import resource
from legfem.common.units import FloatArray

RANGES = resource("ranges", dict[str, PhysicalRange])
"""By what is meant; C10 by the tissue: ``C10.deep``."""
MISTAKEN_UNITS = resource("mistaken_units", dict[str, dict[str, float]])
"""Units that are taken for the right one by column or size, and by what they change a stiffness, about."""
REACHED_MM = 24.0
"""Depth that published presses of calves reach: 25 and 30 mm in the paper."""
LEG_MM2 = (5300.0, 20000.0)
"""Girth times the tibia's width, beyond which both are small, or large, for one leg: calves have
7500 to 11,000 mm², the scanned leg of MULTIS 5740 above the ankle and 15,300 below the knee."""


def c10_of(tissue: str) -> PhysicalRange:
    """Return the range of a tissue's C10; of one without, the deep tissue's."""
    return RANGES.get(f"C10.{tissue}", RANGES["C10.deep"])


def width_of(outline: FloatArray) -> float:
    """Return the diameter of the circle as large as an outline (n, 2), mm."""
    return math.sqrt(4 * Polygon(outline).area / math.pi)


def doubts_about_size(toml: Path, field: str, around: float, tibia: FloatArray) -> Iterator[Doubt]:
    """Yield a doubt about a section that is too large or too small for a leg.

    Parameters
    ----------
    toml, field
        What names the section.
    around
        Its girth, mm.
    tibia : (n, 2) array
        Its outline, mm: bones are of one size where flesh isn't.

    Raises
    ------
    InputError
        For what no leg is.
    """
    remedy = "check that the coordinates are whole lengths in mm, not halved, nor in pixels"
    width = width_of(tibia)
    found = [*RANGES["girth"].doubts(toml, field, around, remedy), *RANGES["tibia"].doubts(toml, field, width, remedy)]
    low, high = LEG_MM2
    if not found and not low <= around * width <= high:
        size = "small" if around * width < low else "large"
        problem = f"a girth of {around:.0f} mm with a tibia {width:.0f} mm wide: both are {size}"
        found.append(Doubt(str(toml), field, f"{problem}, as if the section were scaled", remedy))
    yield from found[:1]

"""Where the numbers of a leg and of its indentation usually lie, and where they can."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from shapely import Polygon

from legfem.common.errors import Doubt, PhysicalRange
from legfem.common.units import FloatArray

PAPER = "Frauziols et al. (2015)"


@dataclass(frozen=True)
class Published:
    """Between which values a quantity was published, and where."""

    low: float
    high: float
    unit: str
    source: str

    def __str__(self) -> str:
        """Return the range and its source."""
        return f"{self.low:g} to {self.high:g} {self.unit}: {self.source}"


REACHED_MM = 24.0
"""Depth that published presses of calves reach: 25 and 30 mm in the paper."""
PUBLISHED_C10 = {
    "deep": Published(0.5, 15.0, "kPa", f"{PAPER} and what it cites"),
    "superficial": Published(1.0, 30.0, "kPa", f"{PAPER}, Table 2"),
}
"""Published C10 of legs' tissues."""
_STRESS = {"Pa": 1e-3, "MPa": 1e3}
_LENGTH = {"cm": 10.0, "m": 1e3, "micrometres": 1e-3}

GIRTH = PhysicalRange(
    "a girth", "mm", (230.0, 700.0), (100.0, 800.0), "calves of adults and more: ANSUR II, Gordon et al. 2014"
)
TIBIA = PhysicalRange(
    "a tibia's width, that of a circle as large,",
    "mm",
    (18.5, 60.0),
    (8.0, 90.0),
    "20 to 30 mm along the shaft, 42 mm below the knee: pQCT, and the scanned leg of MULTIS",
)
LEG_MM2 = (5300.0, 20000.0)
"""Girth times the tibia's width, beyond which both are small, or large, for one leg: calves have
7500 to 11,000 mm², the scanned leg of MULTIS 5740 above the ankle and 15,300 below the knee."""
FASCIA_THICKNESS = PhysicalRange(
    "a fascia's thickness", "mm", (0.1, 3.0), (0.02, 10.0), f"0.2 to 1.0 mm: {PAPER}, Table 2", _LENGTH
)
DIAMETER = PhysicalRange("a cylinder's diameter", "mm", (20.0, 50.0), (2.0, 200.0), f"30 mm: {PAPER}", _LENGTH)
LENGTH = PhysicalRange("a cylinder's length", "mm", (25.0, 150.0), (10.0, 500.0), f"50 mm: {PAPER}", _LENGTH)
DEEP_C10 = PhysicalRange(
    "a deep tissue's C10", "kPa", (0.05, 30.0), (0.002, 600.0), str(PUBLISHED_C10["deep"]), _STRESS
)
C10 = {
    "deep": DEEP_C10,
    "superficial": PhysicalRange(
        "a superficial tissue's C10", "kPa", (0.1, 60.0), (0.005, 600.0), str(PUBLISHED_C10["superficial"]), _STRESS
    ),
    "fascia": PhysicalRange("a fascia's C10", "kPa", (5.0, 5e4), (0.5, 1e6), f"100 kPa: {PAPER}, Table 1", _STRESS),
}
SHEAR_MODULUS = PhysicalRange(
    "a shear modulus",
    "kPa",
    (0.5, 60.0),
    (0.3, 100.0),
    "1 to 30 kPa: shear waves in resting muscle and fat",
    {"Pa": 1e-3, "MPa": 1e3},
)
STIFFENING = PhysicalRange("a ratio C20 / C10", "", (0.0, 20.0), (0.0, 1e4), f"up to 4: {PAPER}, Table 5")
D1 = PhysicalRange(
    "a D1",
    "1/MPa",
    (5e-4, 100.0),
    (1e-4, 2000.0),
    "bulk modulus 2 / D1 of 20 kPa to water's",
    {"1/GPa": 1e-3, "1/Pa": 1e6, "1/kPa": 1e3},
)
SPEED = PhysicalRange(
    "a speed of loading", "mm/s", (0.01, 20.0), (1e-6, 5000.0), f"0.4 mm/s: {PAPER}; by hand some 10 mm/s"
)
FORCE_SD = PhysicalRange("an error of the force", "N", (1e-5, 3.0), (1e-8, 100.0), "data sheets of load cells")
DISPLACEMENT_SD = PhysicalRange(
    "an error of the displacement", "mm", (1e-5, 1.5), (1e-8, 20.0), "data sheets of sensors"
)


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
    width = math.sqrt(4 * Polygon(tibia).area / math.pi)
    found = [*GIRTH.doubts(toml, field, around, remedy), *TIBIA.doubts(toml, field, width, remedy)]
    low, high = LEG_MM2
    if not found and not low <= around * width <= high:
        size = "small" if around * width < low else "large"
        problem = f"a girth of {around:.0f} mm with a tibia {width:.0f} mm wide: both are {size}"
        found.append(Doubt(str(toml), field, f"{problem}, as if the section were scaled", remedy))
    yield from found[:1]

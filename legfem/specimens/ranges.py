"""Where the sizes, speeds and stiffness of specimens usually lie, and where they can."""

from __future__ import annotations

from legfem.common.errors import PhysicalRange
from legfem.data import ranges
from legfem.specimens.kind import LABS, LENGTH_UNITS, length_range

SIZES = {
    "thickness_mm": length_range("a thickness", 0.5, 150.0),
    "diameter_mm": length_range("a specimen's diameter", 3.0, 400.0),
    "height_mm": length_range("a specimen's height", 1.0, 150.0),
    "width_mm": length_range("a specimen's width", 3.0, 500.0),
    "length_mm": length_range("a length", 2.0, 300.0),
    "area_mm2": PhysicalRange("an area", "mm²", (4.0, 2e4), (1e-3, 1e6), LABS, {"cm²": 100.0, "m²": 1e6}),
}
"""By key of ``specimen.toml``; a kind of test has ranges of its own keys."""
SPEED = PhysicalRange("a speed of loading", "mm/s", (1e-3, 100.0), (1e-7, 1e5), "testing machines, 0.06 to 6000 mm/min")
SHARE = {
    True: PhysicalRange(
        "a depth", "of what is pressed", (0.01, 0.8), (1e-5, 1.0), "labs press by 2 to 60 %", LENGTH_UNITS
    ),
    False: PhysicalRange(
        "an elongation", "of the length", (0.01, 2.0), (1e-5, 15.0), "labs pull by 2 to 200 %", LENGTH_UNITS
    ),
}
"""Of the thickness or length: pressed, or pulled."""
SLENDER = PhysicalRange("a height", "times the width", (0.0, 3.0), (0.0, 100.0), "what is taller buckles")
COVERED = PhysicalRange(
    "what presses", "times the specimen's width", (0.0, 1.0), (0.0, 20.0), "it presses a part of it"
)
ANYTHING_SOFT = PhysicalRange(
    "a C10", "kPa", (0.02, 2e3), (1e-5, 1e6), "brain and gels to rubber, E of 0.1 kPa to 12 MPa"
)
STIFFNESS = {"muscle": ranges.C10["deep"], "fat": ranges.C10["superficial"], "adipose": ranges.C10["superficial"]}
"""Of a tissue that is called so."""

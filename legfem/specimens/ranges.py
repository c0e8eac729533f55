"""Where the sizes, speeds and stiffness of specimens usually lie, and where they can."""

from __future__ import annotations

from legfem.common.doubts import PhysicalRange
from legfem.data import ranges

_LENGTH = {"cm": 10.0, "m": 1e3, "micrometres": 1e-3}
_LABS = "specimens and indenters of a lab"


def _length(what: str, low: float, high: float) -> PhysicalRange:
    return PhysicalRange(what, "mm", (low, high), (0.02, 1000.0), _LABS, _LENGTH)


SIZES = {
    "thickness_mm": _length("a thickness", 0.5, 150.0),
    "diameter_mm": _length("a specimen's diameter", 3.0, 400.0),
    "height_mm": _length("a specimen's height", 1.0, 150.0),
    "width_mm": _length("a specimen's width", 3.0, 500.0),
    "length_mm": _length("a length", 2.0, 300.0),
    "ball_diameter_mm": _length("a ball's diameter", 0.5, 80.0),
    "punch_diameter_mm": _length("a punch's diameter", 0.5, 80.0),
    "cylinder_diameter_mm": _length("a cylinder's diameter", 1.0, 100.0),
    "opening_mm": _length("a cup's opening", 1.0, 60.0),
    "rim_mm": _length("a cup's rim", 0.2, 20.0),
    "area_mm2": PhysicalRange("an area", "mm²", (4.0, 2e4), (1e-3, 1e6), _LABS, {"cm²": 100.0, "m²": 1e6}),
}
"""By key of ``specimen.toml``."""
SPEED = PhysicalRange("a speed of loading", "mm/s", (1e-3, 100.0), (1e-7, 1e5), "testing machines, 0.06 to 6000 mm/min")
SHARE = {
    True: PhysicalRange("a depth", "of what is pressed", (0.01, 0.8), (1e-5, 1.0), "labs press by 2 to 60 %", _LENGTH),
    False: PhysicalRange(
        "an elongation", "of the length", (0.01, 2.0), (1e-5, 15.0), "labs pull by 2 to 200 %", _LENGTH
    ),
}
"""Of the thickness or length: pressed, or pulled."""
SLENDER = PhysicalRange("a height", "times the width", (0.0, 3.0), (0.0, 100.0), "what is taller buckles")
ANYTHING_SOFT = PhysicalRange(
    "a C10", "kPa", (0.02, 2e3), (1e-5, 1e6), "brain and gels to rubber, E of 0.1 kPa to 12 MPa"
)
STIFFNESS = {"muscle": ranges.C10["deep"], "fat": ranges.C10["superficial"], "adipose": ranges.C10["superficial"]}
"""Of a tissue that is called so."""

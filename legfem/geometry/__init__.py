"""Leg sections: contours, their checks, smooth curves, and conversion from surfaces' sections."""

from legfem.geometry.contours import read_contours, write_contours
from legfem.geometry.section import (
    PARTS,
    ClosedCurve,
    LegSection,
    fat_thickness,
    first_crossing,
    girth,
    minimal_fat_thickness,
    resample_closed_curve,
    smooth_closed_curve,
)

__all__ = [
    "PARTS",
    "ClosedCurve",
    "LegSection",
    "fat_thickness",
    "first_crossing",
    "girth",
    "minimal_fat_thickness",
    "read_contours",
    "resample_closed_curve",
    "smooth_closed_curve",
    "write_contours",
]

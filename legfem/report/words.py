"""Words that pages share, for values as ``resources/words.toml`` has them, and for directions round a leg.

Coordinates are those of DICOM: x to the patient's left, y to the back. Angles go round the leg from
the front (0 degrees) by the patient's left (90), as one who faces the patient sees it unrolled.
The fibula, where it is named beside the tibia, is on the lateral side.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from legfem.common.numbers import number
from legfem.common.resources import resource
from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import LegShape
from legfem.geometry.section import MUSCLE, LegSection


class DataKind(NamedTuple):
    """What kind of data a page is of, in words."""

    what: str
    explanation: str = ""
    """To stand in brackets behind it."""

    def __str__(self) -> str:
        """Return both."""
        return f"{self.what} ({self.explanation})" if self.explanation else self.what


WORDS = resource("words", dict[str, Any])
"""By the kind of value, and the value."""
ORIGINS = {origin: DataKind(*told) for origin, told in WORDS["origins"].items()}
LAW_NAMES: Mapping[str, str] = WORDS["laws"]
REGION_NAMES: Mapping[str, str] = WORDS["regions"]


def region_words(section: LegSection) -> Mapping[str, str]:
    """Return words for each of a section's tissues, by its name in the model; without muscle there is one."""
    return {"deep": WORDS["pad"]} if MUSCLE in section.lacks else REGION_NAMES


NOT_TESTED: Mapping[str, Sequence[str]] = WORDS["not_tested"]
"""What could not be tested, by the page."""
TOLD: Mapping[str, str] = WORDS["told"]
"""What pages explain, whatever the values are."""

BEYOND_A_FIT = TOLD["beyond_a_fit"]
"""Of an identification that shows nothing wrong."""


MODULI = (2.0, 6.0)
"""Shear modulus, and Young's of what hardly changes its volume, at small strain, over C10."""


def moduli_text(c10: float, error: float, unit: str = "kPa") -> str:
    """Return the moduli at small strain that belong to C10 of an isotropic tissue that hardly changes its volume."""
    shear, young = (f"{number(k * c10, k * error)} {unit}" for k in MODULI)
    return f"shear modulus G = {shear}, Young's modulus E = {young}"


@dataclass(frozen=True)
class Directions:
    """Names of the four sides: at 0, 90, 180 and 270 degrees from the front."""

    names: tuple[str, str, str, str]

    @classmethod
    def of(cls, shape: LegShape) -> "Directions":
        """Return the names, as far as the leg's parts tell."""
        sides = ("left", "right")
        if {"tibia", "fibula"} <= set(shape.bones):
            apart = shape.contours["fibula"].mean(axis=(0, 1)) - shape.contours["tibia"].mean(axis=(0, 1))
            sides = ("lateral", "medial") if apart[0] > 0 else ("medial", "lateral")
        return cls(("anterior", sides[0], "posterior", sides[1]))

    def at(self, angle: float) -> str:
        """Return a direction in words, of an angle in degrees: to the nearest 45."""
        number = round(angle / 45) % 8
        first, second = self.names[(number // 2) % 4], self.names[(number // 2 + 1) % 4]
        if number % 2 == 0:
            return first
        return "-".join(sorted((first, second), key=lambda name: name in self.names[1::2]))

    def sides(self) -> tuple[list[float], list[str]]:
        """Return angles from -180 to 180 degrees and their names, for an axis."""
        angles = [-180.0, -90.0, 0.0, 90.0, 180.0]
        return angles, [self.at(angle) for angle in angles]

    def axis(self) -> str:
        """Return the label of an axis of angles."""
        return f"angle round the leg (° from the front, {self.at(90.0)} at 90)"


def angle_round(points: FloatArray, centre: FloatArray) -> FloatArray:
    """Return the angle round the leg from the front (degrees, -180 to 180) of points (..., 2)."""
    x, y = np.moveaxis(points - centre, -1, 0)
    return np.asarray(np.degrees(np.arctan2(x, -y)))


def unwrapped(points: FloatArray) -> FloatArray:
    """Return the angles of closed contours' points (n, m, 2) about their middles, increasing."""
    centre = points.mean(axis=1, keepdims=True)
    return np.asarray(np.unwrap(angle_round(points, centre), axis=1, period=360.0))


ROUND = np.linspace(-180.0, 180.0, 361)
"""Angles round a leg at which values of its points are drawn, degrees from the front."""


def round_leg(angles: FloatArray, values: FloatArray) -> FloatArray:
    """Return values of a closed contour's points (m,) at `ROUND`."""
    return np.interp(ROUND, angles, values, period=360.0)


def capital(text: str) -> str:
    """Return a text that begins with a capital."""
    return text[:1].upper() + text[1:]

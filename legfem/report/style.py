"""What pages and figures share: names, words, colours, directions round a leg, how data's origin is stated, and saving.

Coordinates are those of DICOM: x to the patient's left, y to the back. Angles go round the leg from
the front (0 degrees) by the patient's left (90), as one who faces the patient sees it unrolled.
The fibula, where it is named beside the tibia, is on the lateral side.
"""

import io
import logging
import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from legfem.common.numbers import number
from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import LegShape
from legfem.geometry.section import LegSection
from legfem.report.folder import ReportFile


class DataKind(NamedTuple):
    """What kind of data a page is of, in words."""

    what: str
    explanation: str = ""
    """To stand in brackets behind it."""

    def __str__(self) -> str:
        """Return both."""
        return f"{self.what} ({self.explanation})" if self.explanation else self.what


ORIGINS = {
    "measured": DataKind("measured data"),
    "reconstructed": DataKind("reconstructed data", "made to resemble a published study; no leg was measured"),
    "simulated": DataKind("simulated data", "forces computed by a model; no leg was measured"),
}


ENERGIES = {
    "neo-hookean": "U = C10 (I1 - 3) + (J - 1)^2 / D1",
    "reduced-polynomial": ("U = C10 (I1 - 3) + C20 (I1 - 3)^2 + (J - 1)^2 / D1 + (J - 1)^4 / D2"),
    "yeoh": "U = C10 (I1 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3 + (J - 1)^2 / D1",
    "exponential": "U = C10 (I1 - 3) + A / b (exp(b (I1 - 3)) - 1 - b (I1 - 3)) + (J - 1)^2 / D1",
}

BEYOND_A_FIT = (
    "A good fit does not rule out a hard region in the muscle, or fat that is stiffer or softer than assumed: they "
    "look like another C10 (studies/cohort: a knot twelve times as stiff as the muscle made C10 21 % too high). legfem "
    "diagnose says which effects may be hidden, and what C10 would be then."
)
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


_log = logging.getLogger(__name__)

# Okabe and Ito's colours, which the colour-blind can tell apart.
LAW_COLOURS = {"neo-hookean": "#D55E00", "reduced-polynomial": "#0072B2", "yeoh": "#009E73", "exponential": "#CC79A7"}
LAW_NAMES = {
    "neo-hookean": "neo-Hookean",
    "reduced-polynomial": "reduced polynomial",
    "yeoh": "Yeoh",
    "exponential": "exponential",
}
REGION_COLOURS = {"superficial": "#F3DFA2", "fascia": "#4D4D4D", "deep": "#D98880"}
REGION_NAMES = {"superficial": "superficial tissue (fat)", "fascia": "fascia", "deep": "deep tissue (muscle)"}
BONE_COLOUR = "#FAFAF5"
TOOL_COLOUR = "#B8C4CC"
DATA_COLOUR = "#111111"
FAINT = "#8C8C8C"
LOCATED_COLOUR = "#F0E442"
"""Where a model is wrong."""


def part_colour(section: LegSection, part: str) -> str:
    """Return the colour of what lies within an outline of a section."""
    if part in section.bones:
        return BONE_COLOUR
    return REGION_COLOURS["superficial" if part == "skin" else "deep"]


_STYLE = {
    "font.size": 10,
    "axes.titlesize": 11,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "svg.hashsalt": "legfem",
}

styled = matplotlib.rc_context(_STYLE)
"""Decorator of what draws a figure; leaves matplotlib's own settings as they were."""


class _Shown(Figure):
    """A figure that a notebook shows, though pyplot doesn't know it."""

    def _repr_png_(self) -> bytes:
        return png(self)


def png(figure: Figure) -> bytes:
    """Return a figure as a notebook shows it (80 dots an inch)."""
    image = io.BytesIO()
    figure.savefig(image, format="png", dpi=80)
    return image.getvalue()


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size in inches."""
    return _Shown(figsize=(width, height), layout="constrained")


_TITLE_SIZE, _LETTER = 12, 0.57
"""Of titles: points, and a letter's mean width over them."""


def titled(width: float, height: float, what: str, subject: str, origin: str) -> Figure:
    """Return an empty figure whose title ends with where the data come from, in as many lines as it needs."""
    figure, across = new_figure(width, height), int(72 * width / (_LETTER * _TITLE_SIZE))
    lines = [textwrap.fill(line, across) for line in (*what.splitlines(), f"{subject}: {origin} data")]
    figure.suptitle("\n".join(lines), x=0.01, ha="left", fontsize=_TITLE_SIZE)
    return figure


def panel(axes: Axes, letter: str, name: str) -> None:
    """Title a panel."""
    axes.set_title(f"$\\bf{{{letter}}}$  {name}")


@styled
def save(figure: Figure, out: Path, name: str, svg: bool = False) -> list[Path]:
    """Write a figure as PNG (200 dots an inch) and, where it is small, SVG."""
    png = out / f"{name}.png"
    figure.savefig(png, dpi=200)
    if not svg:
        return [png]
    # Laid out already, which takes as long as the drawing.
    figure.set_layout_engine("none")
    vector = out / f"{name}.svg"
    figure.savefig(vector, metadata={"Date": None})
    return [png, vector]


def picture(figure: Figure, out: Path, name: str, shows: str, svg: bool = False) -> ReportFile:
    """Write a figure of a report, as `save` does; one that can't be written is left out, which is said."""
    try:
        return ReportFile(save(figure, out, name, svg), shows)
    except OSError as error:
        _log.warning("%s.png: can't be written (%s): the report does without it", name, error.strerror)
        for half in out.glob(f"{name}.*"):
            half.unlink()
        return ReportFile([], shows)

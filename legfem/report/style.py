"""Looks that pages' figures share: colours, how a figure is titled, and saving."""

import io
import logging
import textwrap
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from legfem.common.resources import resource
from legfem.geometry.section import LegSection
from legfem.report.folder import ReportFile
from legfem.report.words import region_words

_log = logging.getLogger(__name__)

# Okabe and Ito's colours, which the colour-blind can tell apart.
LAW_COLOURS = {"neo-hookean": "#D55E00", "reduced-polynomial": "#0072B2", "yeoh": "#009E73", "exponential": "#CC79A7"}
REGION_COLOURS = {"superficial": "#F3DFA2", "fascia": "#4D4D4D", "deep": "#D98880"}
BONE_COLOUR = "#FAFAF5"
TOOL_COLOUR = "#B8C4CC"
DATA_COLOUR = "#111111"
FAINT = "#8C8C8C"
LOCATED_COLOUR = "#F0E442"
"""Where a model is wrong."""


def regions(section: LegSection) -> dict[str, tuple[str, str]]:
    """Return the words for each of a section's tissues, and its colour; that of one alone is fat's."""
    words = region_words(section)
    return {name: (one, REGION_COLOURS[name if len(words) > 1 else "superficial"]) for name, one in words.items()}


def part_colour(section: LegSection, part: str) -> str:
    """Return the colour of what lies within an outline of a section."""
    if part in section.bones:
        return BONE_COLOUR
    return REGION_COLOURS["superficial" if part == "skin" else "deep"]


styled = matplotlib.rc_context(resource("figures", dict[str, Any]))
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

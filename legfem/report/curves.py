"""Curves of a page, as a script, a figure and a table show them; blocks that show thousands of things at once."""

import base64
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from legfem.common.units import FloatArray
from legfem.report import style
from legfem.report.words import LAW_NAMES

Dash = Literal["solid", "dashed", "dotted", "dotdash"]
_MOST_ROWS = 25


class Block:
    """What stands in a chapter of a page."""

    kind: ClassVar[str]
    """By which the page's template finds how to show it."""


@dataclass(frozen=True, eq=False)
class Line:
    """One curve in both panels."""

    name: str
    above: FloatArray | None
    """(n,)."""
    below: FloatArray | None
    """(n,): the difference; None where it has none."""
    colour: str = style.DATA_COLOUR
    dash: Dash = "solid"
    points: bool = False
    """Whether it is drawn as points, not as a line."""
    faint: bool = False
    """Whether it is one of many, drawn thin."""
    tabled: bool = True
    """Whether it stands in the table behind the plot and under the cursor."""


def law_line(law: str, above: FloatArray, below: FloatArray | None, dash: Dash = "solid", points: bool = False) -> Line:
    """Return what the model makes of a test with a law, and its difference from the recording."""
    return Line(f"model, {LAW_NAMES[law]}", above, below, style.LAW_COLOURS[law], dash, points)


@dataclass(frozen=True, eq=False)
class Curves(Block):
    """Two panels over one abscissa, or one."""

    kind: ClassVar[str] = "curves"
    name: str
    """Short, without spaces; one of its own in a page."""
    title: str
    """What is seen, in short: the beginning of the caption."""
    more: str
    """How the caption goes on, with the mark between."""
    x: FloatArray
    """(n,)."""
    x_label: str
    above_label: str
    lines: Sequence[Line]
    band: FloatArray | None = None
    """(n,): half the width of a band: about zero in the lower style.panel, else about the first line."""
    band_name: str = ""
    located: Sequence[tuple[float, float]] = ()
    """Stretches of the abscissa that are marked in the lower style.panel."""
    located_name: str = ""
    below_label: str = ""
    """Empty for no lower style.panel."""

    @property
    def caption(self) -> str:
        """What is seen, in words: also for those who can't see it."""
        return f"{self.title}{self.more}"

    @property
    def header(self) -> list[str]:
        """Return that of the table behind the plot."""
        names = [line.name for line in self.lines if line.tabled]
        return [self.x_label, *(f"{name}: {self.above_label}" for name in names)]

    @property
    def rows(self) -> list[list[str]]:
        """Return the rows of the table behind the plot."""
        picked = np.unique(np.linspace(0, len(self.x) - 1, _MOST_ROWS).round().astype(int))
        tabled = [line.above for line in self.lines if line.tabled and line.above is not None]
        return [
            [f"{self.x[k]:.2f}", *(f"{a[k]:.3f}" if np.isfinite(a[k]) else "–" for a in tabled)]
            for k in picked.tolist()
        ]

    @property
    def bands(self) -> list[list[FloatArray]]:
        """Abscissa, lower and upper end of the band, part by part where the abscissa goes on one way."""
        if self.band is None:
            return []
        about = None if self.below_label else self.lines[0].above
        middle = np.zeros(len(self.x)) if about is None else about
        return [[each[way] for each in (self.x, middle - self.band, middle + self.band)] for way in ways(self.x)]

    @property
    def data(self) -> dict[str, Any]:
        """What ``plots.js`` reads."""
        return {
            "x": _listed(self.x),
            "label": self.x_label,
            "labels": [self.above_label, self.below_label],
            "lines": [
                {
                    "name": line.name,
                    "values": [_listed(line.above), _listed(line.below)],
                    "colour": line.colour,
                    "dash": line.dash,
                    "points": line.points,
                    "faint": line.faint,
                    "read": line.tabled,
                }
                for line in self.lines
            ],
            "band": [list(map(_listed, part)) for part in self.bands],
            "located": joined(self.located),
        }


def _listed(values: FloatArray | None) -> list[float | None] | None:
    """Return numbers as JSON has them, of six digits; None where there is none."""
    if values is None:
        return None
    return [float(f"{value:.6g}") if np.isfinite(value) else None for value in map(float, values)]


def ways(x: FloatArray) -> list[slice]:
    """Return where an abscissa goes on one way: a band that turns back on itself isn't filled."""
    signs = np.sign(np.diff(x))
    moving = np.flatnonzero(signs)
    turns = moving[1:][np.diff(signs[moving]) != 0]
    return [slice(a, b + 1) for a, b in pairwise([0, *turns.tolist(), len(x) - 1])]


def joined(stretches: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return stretches in their order, those that overlap as one."""
    joined: list[tuple[float, float]] = []
    for low, high in sorted(stretches):
        if joined and low <= joined[-1][1]:
            joined[-1] = joined[-1][0], max(joined[-1][1], high)
        else:
            joined.append((float(low), float(high)))
    return joined


_STROKES: dict[Dash, str] = {"solid": "-", "dashed": "--", "dotted": ":", "dotdash": "-."}
_ACROSS, _LETTERS = 3, 52
"""Blocks side by side, and letters of a style.panel's title in a line."""
_MOST_POINTS = 60


@style.styled
def curves_figure(blocks: Sequence[Curves], what: str, subject: str, origin: str) -> Figure:
    """Draw blocks of a page.

    Parameters
    ----------
    blocks
        Each is a style.panel of its title.
    what
        Is drawn; lines.
    subject, origin
        Whose data, and what kind.
    """
    across = min(len(blocks), _ACROSS)
    down = -(-len(blocks) // across)
    heights = [2.2, 1.0] if any(block.below_label for block in blocks) else [2.2]
    width, height = 5.4 * across + (0.6 if across > 1 else 2.0), 2.0 * sum(heights) * down
    figure = style.titled(width, height, what, subject, origin)
    rows = len(heights)
    grid = figure.subplots(rows * down, across, squeeze=False, height_ratios=heights * down)
    panels = [column for row in range(down) for column in grid[rows * row : rows * (row + 1)].T]
    for k, axes in enumerate(panels):
        if k < len(blocks):
            style.panel(axes[0], chr(ord("A") + k), textwrap.fill(blocks[k].title, _LETTERS))
            _draw(axes[0], axes[-1], blocks[k])
        else:
            for one in axes:
                one.axis("off")
    return figure


def _draw(above: Axes, below: Axes, block: Curves) -> None:
    """Draw a block on its panels, which are one where none of a figure's blocks has a lower one."""
    lowest = below if block.below_label else above
    for number, (x, low, high) in enumerate(block.bands):
        label = "" if number else block.band_name
        lowest.fill_between(x, low, high, color=style.FAINT, alpha=0.35, linewidth=0, label=label)
    for number, (begin, end) in enumerate(joined(block.located)):
        label = "" if number else block.located_name
        lowest.axvspan(begin, end, color=style.LOCATED_COLOUR, alpha=0.4, linewidth=0, label=label)
    for line in block.lines:
        drawn: dict[str, Any] = {
            "color": line.colour,
            "linewidth": 0.6 if line.faint else 1.6,
            "linestyle": _STROKES[line.dash],
        }
        if line.points:
            every = max(1, len(block.x) // _MOST_POINTS)
            drawn |= {"linestyle": "", "marker": "o", "markersize": 3.2, "fillstyle": "none", "markevery": every}
        for axes, values, label in ((above, line.above, line.name if line.tabled else ""), (below, line.below, "")):
            if values is not None:
                axes.plot(block.x, values, label=label, **drawn)
    above.set_ylabel(block.above_label)
    above.legend(loc="best", fontsize=8)
    lowest.set_xlabel(block.x_label)
    if block.below_label:
        below.axhline(0.0, color=style.DATA_COLOUR, linewidth=0.6)
        below.set_ylabel(block.below_label)
        if block.band_name or block.located_name:
            below.legend(loc="best", fontsize=8)
        below.set_xlim(*above.get_xlim())
    elif below is not above:
        below.axis("off")


def packed(values: NDArray[Any], kind: str) -> str:
    """Return counts as text; what a whole number can't hold becomes the nearest that it can.

    Parameters
    ----------
    values
        Counts, in C order.
    kind
        NumPy's name of the type: ``<i2`` or ``<u2``.
    """
    limits = np.iinfo(np.dtype(kind))
    whole = np.clip(np.round(values), limits.min, limits.max).astype(kind)
    return base64.b64encode(whole.tobytes()).decode()


type Cell = str | float | tuple[float, str] | None
"""A text, a number, or a number (by which rows are sorted) with the text that is shown for it."""
_MOST_IN_TEXT = 60
_FINEST = 32000
"""Counts in the greatest value of a curve."""


def shown(cell: Cell) -> str:
    """Return what a reader sees of a cell."""
    if cell is None:
        return "–"
    if isinstance(cell, tuple):
        return cell[1]
    return cell if isinstance(cell, str) else f"{cell:.3g}"


@dataclass(frozen=True)
class SortableTable(Block):
    """A table that a reader sorts by any column and searches; only rows in view are drawn."""

    kind: ClassVar[str] = "sortable"
    name: str
    """Short, without spaces; one of its own in a page."""
    caption: str
    header: Sequence[str]
    cells: Sequence[Sequence[Cell]]
    links: Sequence[str] = ()
    """Links of the rows' first cells; empty for none."""

    @property
    def data(self) -> dict[str, Any]:
        """What ``many.js`` reads."""
        return {"rows": self.cells, "links": self.links}

    @property
    def rows(self) -> list[list[str]]:
        """Return the first rows as texts, and how many more there are."""
        texts = [list(map(shown, row)) for row in self.cells[:_MOST_IN_TEXT]]
        left = len(self.cells) - len(texts)
        return [*texts, [f"and {left} more", *[""] * (len(self.header) - 1)]] if left else texts


@dataclass(frozen=True)
class ForestMetric:
    """One parameter of all members."""

    label: str
    unit: str
    values: Sequence[float | None]
    low: Sequence[float | None]
    high: Sequence[float | None]


@dataclass(frozen=True)
class Grouped:
    """Members of whom something is drawn, coloured by group."""

    names: Sequence[str]
    groups: Sequence[tuple[str, str]]
    """Names and colours."""
    group: Sequence[int]
    """Number of each member's."""

    @property
    def data(self) -> dict[str, Any]:
        """What ``many.js`` reads of any."""
        return {"names": self.names, "colours": [colour for _, colour in self.groups], "group": self.group}


@dataclass(frozen=True)
class Forest(Block):
    """Values with their intervals, one line a member, sorted."""

    kind: ClassVar[str] = "forest"
    caption: str
    members: Grouped
    metrics: Sequence[ForestMetric]

    @property
    def data(self) -> dict[str, Any]:
        """What ``many.js`` reads."""
        return {**self.members.data, "metrics": list(map(vars, self.metrics))}


@dataclass(frozen=True, eq=False)
class Bundle(Block):
    """Curves of all members over one abscissa, coloured by group."""

    kind: ClassVar[str] = "bundle"
    caption: str
    members: Grouped
    x: FloatArray
    """(n,)."""
    x_label: str
    y_label: str
    values: FloatArray
    """(members, n); NaN where there is none."""

    @property
    def data(self) -> dict[str, Any]:
        """What ``many.js`` reads."""
        most = float(np.nanmax(np.abs(self.values), initial=0.0)) or 1.0
        counts = np.where(np.isfinite(self.values), self.values * (_FINEST / most), -_FINEST - 1)
        return {
            **self.members.data,
            "x": np.round(self.x, 3).tolist(),
            "labels": [self.x_label, self.y_label],
            "most": most,
            "finest": _FINEST,
            "counts": packed(counts, "<i2"),
        }

"""A page's curves as a figure: blocks beside each other, each with its panels."""

import re
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from legfem.report.curves import Curves, Dash, joined, ways
from legfem.report.style import DATA_COLOUR, FAINT, LOCATED_COLOUR, new_figure, panel, styled, title

_STROKES: dict[Dash, str] = {"solid": "-", "dashed": "--", "dotted": ":", "dotdash": "-."}
_ACROSS, _LETTERS = 3, 52
"""Blocks side by side, and letters of a panel's title in a line."""
_MOST_POINTS = 60


@styled
def curves_figure(blocks: Sequence[Curves], what: str, subject: str, origin: str) -> Figure:
    """Draw blocks of a page.

    Parameters
    ----------
    blocks
        Their first clause titles them.
    what
        Is drawn; lines.
    subject, origin
        Whose data, and what kind.
    """
    across = min(len(blocks), _ACROSS)
    down = -(-len(blocks) // across)
    heights = [2.2, 1.0] if any(block.below_label for block in blocks) else [2.2]
    figure = new_figure(5.4 * across + (0.6 if across > 1 else 2.0), 2.0 * sum(heights) * down)
    title(figure, what, subject, origin)
    rows = len(heights)
    grid = figure.subplots(rows * down, across, squeeze=False, height_ratios=heights * down)
    panels = [column for row in range(down) for column in grid[rows * row : rows * (row + 1)].T]
    for k, axes in enumerate(panels):
        if k < len(blocks):
            name = re.split(r"[:;]|, (?=over|recorded)", blocks[k].caption)[0].rstrip(".")
            panel(axes[0], chr(ord("A") + k), textwrap.fill(name, _LETTERS))
            _draw(axes[0], axes[-1], blocks[k])
        else:
            for one in axes:
                one.axis("off")
    return figure


def _draw(above: Axes, below: Axes, block: Curves) -> None:
    """Draw a block on its panels, which are one where none of a figure's blocks has a lower one."""
    lowest = below if block.below_label else above
    if block.band is not None:
        first = None if block.below_label else block.lines[0].above
        middle = np.zeros(len(block.x)) if first is None else first
        for number, way in enumerate(ways(block.x)):
            x, low, high = (values[way] for values in (block.x, middle - block.band, middle + block.band))
            label = "" if number else block.band_name
            lowest.fill_between(x, low, high, color=FAINT, alpha=0.35, linewidth=0, label=label)
    for number, (begin, end) in enumerate(joined(block.located)):
        label = "" if number else block.located_name
        lowest.axvspan(begin, end, color=LOCATED_COLOUR, alpha=0.4, linewidth=0, label=label)
    for line in block.lines:
        style: dict[str, Any] = {
            "color": line.colour,
            "linewidth": 0.6 if line.faint else 1.6,
            "linestyle": _STROKES[line.dash],
        }
        if line.points:
            every = max(1, len(block.x) // _MOST_POINTS)
            style |= {"linestyle": "", "marker": "o", "markersize": 3.2, "fillstyle": "none", "markevery": every}
        for axes, values, label in ((above, line.above, line.name if line.tabled else ""), (below, line.below, "")):
            if values is not None:
                axes.plot(block.x, values, label=label, **style)
    above.set_ylabel(block.above_label)
    above.legend(loc="best", fontsize=8)
    lowest.set_xlabel(block.x_label)
    if block.below_label:
        below.axhline(0.0, color=DATA_COLOUR, linewidth=0.6)
        below.set_ylabel(block.below_label)
        if block.band_name or block.located_name:
            below.legend(loc="best", fontsize=8)
        below.set_xlim(*above.get_xlim())
    elif below is not above:
        below.axis("off")

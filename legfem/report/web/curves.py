"""Curves with a cursor and zoom, by Bokeh: what was recorded and simulated, the difference beneath.

Lines are switched on and off by the check boxes of the page's own legend, which a keyboard reaches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise
from typing import Any, ClassVar, Literal, Protocol

import numpy as np
from bokeh.embed import components
from bokeh.layouts import column
from bokeh.models import BoxAnnotation, ColumnDataSource, CrosshairTool, HoverTool, InlineStyleSheet, Span
from bokeh.plotting import figure
from bokeh.resources import Resources

from legfem.common.units import FloatArray
from legfem.report.style import DATA_COLOUR, FAINT

Dash = Literal["solid", "dashed", "dotted", "dotdash"]
_MOST_ROWS = 25
_TOOLS = "box_zoom,xwheel_zoom,pan,reset"
_LEFT = 64
"""Pixels, so that the axes of both panels stand over each other."""


@dataclass(frozen=True, eq=False)
class Line:
    """One curve in both panels."""

    name: str
    above: FloatArray | None
    """(n,)."""
    below: FloatArray | None
    """(n,): the difference; None where it has none."""
    colour: str = DATA_COLOUR
    dash: Dash = "solid"
    points: bool = False
    """Whether it is drawn as points, not as a line."""
    faint: bool = False
    """Whether it is one of many, drawn thin."""
    tabled: bool = True
    """Whether it stands in the table behind the plot and under the cursor."""


@dataclass(frozen=True, eq=False)
class Curves:
    """Two panels over one abscissa, or one."""

    kind: ClassVar[str] = "curves"
    name: str
    """Short, without spaces; one of its own in a page."""
    caption: str
    """What is seen, in words: also for those who can't see it."""
    x: FloatArray
    """(n,)."""
    x_label: str
    above_label: str
    below_label: str
    """Empty for no lower panel."""
    lines: Sequence[Line]
    band: FloatArray | None = None
    """(n,): half the width of a band: about zero in the lower panel, else about the first line."""
    band_name: str = ""
    located: Sequence[tuple[float, float]] = ()
    """Stretches of the abscissa that are marked in the lower panel."""
    located_name: str = ""

    def figure(self) -> Any:
        """Return the panels, for Bokeh; a line is found again by the names of its curves."""
        return _panels(self)

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


class Plotted(Protocol):
    """What Bokeh draws on a page."""

    @property
    def name(self) -> str:
        """Of its own in a page."""

    def figure(self) -> Any:
        """Return a model of Bokeh's."""


@dataclass(frozen=True)
class Embedded:
    """Plots as parts of a page."""

    library: str
    """Script elements that hold Bokeh itself."""
    script: str
    places: dict[str, str]
    """By the plot's name, the element that it is drawn into."""


def embedded(plots: Sequence[Plotted]) -> Embedded:
    """Return plots as HTML; the library is in it, so that nothing is loaded."""
    if not plots:
        return Embedded("", "", {})
    library = Resources(mode="inline", components=["bokeh"], log_level="error").render_js()
    script, places = components({one.name: one.figure() for one in plots})
    return Embedded(library, script, places)


def _panels(curves: Curves) -> Any:
    cursor = Span(dimension="height", line_width=1, line_dash="dashed", line_color=FAINT)
    above = panel(320, curves.above_label)
    panels = [above]
    if curves.below_label:
        panels.append(panel(200, curves.below_label, x_range=above.x_range, toolbar_location=None))
        above.xaxis.major_label_text_font_size = "0pt"
    below = panels[-1]
    below.xaxis.axis_label = curves.x_label
    for one in panels:
        one.add_tools(CrosshairTool(overlay=cursor, dimensions="height"))
    source = ColumnDataSource({"x": curves.x})
    below.add_layout(Span(location=0, dimension="width", line_width=1, line_color=DATA_COLOUR))
    for left, right in _joined(curves.located):
        below.add_layout(
            BoxAnnotation(
                left=left,
                right=right,
                fill_color="#F0E442",
                fill_alpha=0.25,
                line_color=None,
                hatch_pattern="/",
                hatch_color=FAINT,
                hatch_alpha=0.35,
                hatch_weight=0.5,
                level="underlay",
            )
        )
    if curves.band is not None:
        about = curves.lines[0].above if below is above else None
        middle = np.zeros(len(curves.x)) if about is None else about
        low, high = middle - curves.band, middle + curves.band
        for way in ways(curves.x):
            below.varea(curves.x[way], low[way], high[way], color=FAINT, alpha=0.3)
    for number, line in enumerate(curves.lines):
        for one, values, place in ((above, line.above, "above"), (below, line.below, "below")):
            if values is not None:
                key = f"{place}{number}"
                source.data[key] = values
                _draw(one, source, key, line, f"{curves.name}-{place}-{number}")
    _add_readings(above, below, source, curves)
    return column(*panels, sizing_mode="stretch_width", spacing=0)


def ways(x: FloatArray) -> list[slice]:
    """Return where an abscissa goes on one way: a band that turns back on itself isn't filled."""
    signs = np.sign(np.diff(x))
    moving = np.flatnonzero(signs)
    turns = moving[1:][np.diff(signs[moving]) != 0]
    return [slice(a, b + 1) for a, b in pairwise([0, *turns.tolist(), len(x) - 1])]


def _joined(stretches: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return stretches in their order, those that overlap as one."""
    joined: list[tuple[float, float]] = []
    for low, high in sorted(stretches):
        if joined and low <= joined[-1][1]:
            joined[-1] = joined[-1][0], max(joined[-1][1], high)
        else:
            joined.append((low, high))
    return joined


def panel(height: int, label: str, **options: Any) -> Any:
    """Return an empty panel with the page's tools and types."""
    made = figure(
        height=height,
        sizing_mode="stretch_width",
        tools=_TOOLS,
        active_drag="box_zoom",
        min_border_left=_LEFT,
        min_border_right=12,
        output_backend="svg",
        **options,
    )
    made.toolbar.logo = None
    made.toolbar.stylesheets = [InlineStyleSheet(css="@media print { :host { display: none; } }")]
    made.yaxis.axis_label = label
    made.yaxis.formatter.use_scientific = False
    for axis in (*made.xaxis, *made.yaxis):
        axis.axis_label_text_font_style = "normal"
        axis.axis_label_text_font_size = "13px"
        axis.major_label_text_font_size = "12px"
    return made


def _draw(place: Any, source: ColumnDataSource, key: str, line: Line, name: str) -> None:
    if line.points:
        place.scatter("x", key, source=source, size=5, fill_color=None, line_color=line.colour, name=name)
        return
    place.line(
        "x",
        key,
        source=source,
        color=line.colour,
        line_dash=line.dash,
        name=name,
        line_width=1 if line.faint else 2,
        line_alpha=0.7 if line.faint else 1.0,
    )


def _add_readings(above: Any, below: Any, source: ColumnDataSource, curves: Curves) -> None:
    """Add what stands beside the cursor: all values there, in either panel."""
    first = [(curves.x_label, "@x{0.00}")]
    for drawn, place in ((above, "above"), (below, "below")):
        shown = [
            (line.name, f"@{place}{k}{{0.000}}")
            for k, line in enumerate(curves.lines)
            if line.tabled and f"{place}{k}" in source.data
        ]
        if not shown:
            continue
        # One that is always there to be hit, whatever is switched off.
        (key,) = [text.split("{")[0].removeprefix("@") for _, text in shown[:1]]
        target = drawn.line("x", key, source=source, line_alpha=0)
        drawn.add_tools(
            HoverTool(
                renderers=[target],
                tooltips=_readings([*first, *shown]),
                mode="vline",
                point_policy="snap_to_data",
                line_policy="nearest",
            )
        )


def _readings(rows: Sequence[tuple[str, str]]) -> str:
    """Return what stands beside the cursor, in ink: Bokeh's own labels are too pale to read."""
    return "".join(f'<div><span style="color: #444">{_literal(name)}:</span> {value}</div>' for name, value in rows)


def _literal(text: str) -> str:
    """Return text that Bokeh and HTML take as it is."""
    return escape(text).replace("@", "&#64;").replace("$", "&#36;")

"""A page as one file of HTML that loads nothing; its curves have a cursor and zoom, by Bokeh.

Lines are switched on and off by the check boxes of the page's own legend, which a keyboard reaches.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise
from typing import Any

import numpy as np
from bokeh.embed import components
from bokeh.layouts import column
from bokeh.models import (
    BoxAnnotation,
    ColorBar,
    ColumnDataSource,
    CrosshairTool,
    FixedTicker,
    HoverTool,
    InlineStyleSheet,
    LinearColorMapper,
    Span,
)
from bokeh.palettes import YlGnBu9
from bokeh.plotting import figure
from bokeh.resources import Resources
from jinja2 import Environment, PackageLoader, StrictUndefined
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup

from legfem.common.units import FloatArray
from legfem.common.versions import legfem_build
from legfem.report.page import PROVENANCE, SURFACE_CELLS, TONES, Curves, Line, ResponseSurface, WebPage
from legfem.report.style import DATA_COLOUR, FAINT
from legfem.report.words import ORIGINS

_TOOLS = "box_zoom,xwheel_zoom,pan,reset"
_LEFT = 64
"""Pixels, so that the axes of both panels stand over each other."""


@dataclass(frozen=True)
class Embedded:
    """Plots as parts of a page."""

    library: str
    """Script elements that hold Bokeh itself."""
    script: str
    places: dict[str, str]
    """By the plot's name, the element that it is drawn into."""


def embed(data: Any) -> Markup:
    """Data as JSON that a page's script element can contain, whatever text is in it.

    ``<``, ``>``, ``&`` and ``'`` are written as escapes of JSON, and so is all that isn't ASCII (U+2028 and U+2029
    end a line in a script): no text ends the element or begins another. All pages embed data by this function.
    """
    return htmlsafe_json_dumps(data, allow_nan=False)


def embedded(plots: Sequence[Curves | ResponseSurface]) -> Embedded:
    """Return plots as HTML; the library is in it, so that nothing is loaded."""
    if not plots:
        return Embedded("", "", {})
    library = Resources(mode="inline", components=["bokeh"], log_level="error").render_js()
    script, places = components({one.name: _panels(one) if isinstance(one, Curves) else _surface(one) for one in plots})
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


def _surface(block: ResponseSurface) -> Any:
    """Map of a response surface, which ``response.js`` fills."""
    ends = [-1.0 + 2.0 * k / (SURFACE_CELLS - 1) for k in range(SURFACE_CELLS)]
    cells = [(x, y) for y in ends for x in ends]
    source = ColumnDataSource(
        {"x": [x for x, _ in cells], "y": [y for _, y in cells], "value": [0.0] * len(cells)}, name="response-cells"
    )
    colours = LinearColorMapper(palette=YlGnBu9[::-1], low=0, high=1, name="response-colours")
    made = panel(420, "", x_range=(-1.05, 1.05), y_range=(-1.05, 1.05), toolbar_location=None)
    side = 2.0 / (SURFACE_CELLS - 1)
    made.rect("x", "y", side, side, source=source, line_color=None, fill_color={"field": "value", "transform": colours})
    at = ColumnDataSource({"x": [0.0], "y": [0.0]}, name="response-at")
    made.scatter("x", "y", source=at, size=13, marker="cross", line_color="#D55E00", line_width=3)
    made.add_layout(ColorBar(color_mapper=colours, width=12), "right")
    for axis, name in ((made.xaxis[0], "response-x"), (made.yaxis[0], "response-y")):
        axis.name, axis.ticker = name, FixedTicker(ticks=[-1, 0, 1])
    made.grid.visible = False
    return made


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


def rendered(page: WebPage) -> str:
    """Return a page as HTML that loads nothing."""
    environment = Environment(
        loader=PackageLoader("legfem", "resources/web"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["embed"] = embed
    blocks = [block for chapter in page.chapters for block in chapter.blocks]
    kinds = {block.kind for block in blocks}
    return environment.get_template("report.html").render(
        page=page,
        tone=page.headline.heading or TONES[page.headline.tone],
        data=page.data or ORIGINS[page.origin],
        provenances=PROVENANCE,
        plots=embedded([b for b in blocks if isinstance(b, Curves | ResponseSurface)]),
        scripts=list(dict.fromkeys(name for kind, name in _SCRIPTS.items() if kind in kinds)),
        legfem=legfem_build(),
    )


_SCRIPTS: Mapping[str, str] = {
    "pressed": "press.js",
    "turned": "turn.js",
    "response": "response.js",
    "sortable": "many.js",
    "forest": "many.js",
    "bundle": "many.js",
}

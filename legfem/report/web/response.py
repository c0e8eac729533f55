"""A response surface on a page: a polynomial of coded factors, over any two of them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from bokeh.models import ColorBar, ColumnDataSource, FixedTicker, LinearColorMapper
from bokeh.palettes import YlGnBu9

from legfem.report.web.curves import panel

_CELLS = 21
"""Along either axis."""


@dataclass(frozen=True)
class SurfaceFactor:
    """What is varied from -1 to +1."""

    label: str
    levels: tuple[str, str, str]
    """At -1, 0 and +1, as people read them."""


@dataclass(frozen=True)
class SurfaceMetric:
    """What is predicted."""

    label: str
    unit: str
    coefficients: Mapping[tuple[int, ...], float]
    """By the factors' numbers in a term: none for the mean, two for an interaction."""


@dataclass(frozen=True, eq=False)
class ResponseSurface:
    """A map of a metric over two factors; the others are set with sliders."""

    kind: ClassVar[str] = "response"
    name: ClassVar[str] = "response"
    caption: str
    factors: Sequence[SurfaceFactor]
    metrics: Sequence[SurfaceMetric]
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    """The coefficients as a table."""
    shown: tuple[int, int] = (0, 1)
    """Numbers of the factors on the axes at first."""

    @property
    def data(self) -> str:
        """JSON for ``response.js``."""
        return json.dumps(
            {
                "cells": _CELLS,
                "factors": [{"label": f.label, "levels": f.levels} for f in self.factors],
                "metrics": [
                    {
                        "label": m.label,
                        "unit": m.unit,
                        "terms": [[list(term), value] for term, value in m.coefficients.items()],
                    }
                    for m in self.metrics
                ],
            }
        )

    def figure(self) -> Any:
        """Return the map, for Bokeh; ``response.js`` fills it."""
        ends = [-1.0 + 2.0 * k / (_CELLS - 1) for k in range(_CELLS)]
        cells = [(x, y) for y in ends for x in ends]
        source = ColumnDataSource(
            {"x": [x for x, _ in cells], "y": [y for _, y in cells], "value": [0.0] * len(cells)}, name="response-cells"
        )
        colours = LinearColorMapper(palette=YlGnBu9[::-1], low=0, high=1, name="response-colours")
        made = panel(420, "", x_range=(-1.05, 1.05), y_range=(-1.05, 1.05), toolbar_location=None)
        side = 2.0 / (_CELLS - 1)
        made.rect(
            "x", "y", side, side, source=source, line_color=None, fill_color={"field": "value", "transform": colours}
        )
        at = ColumnDataSource({"x": [0.0], "y": [0.0]}, name="response-at")
        made.scatter("x", "y", source=at, size=13, marker="cross", line_color="#D55E00", line_width=3)
        made.add_layout(ColorBar(color_mapper=colours, width=12), "right")
        for axis, name in ((made.xaxis[0], "response-x"), (made.yaxis[0], "response-y")):
            axis.name, axis.ticker = name, FixedTicker(ticks=[-1, 0, 1])
        made.grid.visible = False
        return made

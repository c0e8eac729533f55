"""Figure of the parameters before and after, with their 95 % intervals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from legfem.inverse.explanation import Explanation
from legfem.inverse.mechanism import null_of
from legfem.inverse.verdict import Diagnosis
from legfem.report.diagnosis_style import BASE_COLOUR, BASE_NAME, REPAIRED_COLOUR, determined, plain, shown_models
from legfem.report.style import DATA_COLOUR, FAINT, new_figure, panel, styled, title
from legfem.report.words import number

ROWS = 4


@dataclass(frozen=True, eq=False)
class EstimateRow:
    """A parameter's estimate in one model."""

    model: str
    explanation: Explanation
    colour: str


@styled
def parameter_figure(found: Diagnosis, subject: str, origin: str) -> Figure:
    """Return the deep tissue's parameters in every model and the mechanisms' own, with a title."""
    models = shown_models(found)[: ROWS - 1]
    rows = [EstimateRow(BASE_NAME, found.base, BASE_COLOUR)]
    rows += [EstimateRow(m.name, m.model, REPAIRED_COLOUR if m.suits else FAINT) for m in models]
    stiffness = found.base.fit.stiffness
    panels: list[tuple[str, str, list[EstimateRow], float | None]]
    panels = [(f"{name} of the deep tissue (kPa)", name, rows, None) for name in stiffness]
    for mechanism in dict.fromkeys(m for row in rows for m in row.explanation.fit.mechanisms):
        for k, p in enumerate(mechanism.parameters):
            name = f"{mechanism.name}.{p.name}"
            mine = [row for row in rows if name in row.explanation.fit.free]
            unit = "" if p.unit == "-" else f" ({p.unit})"
            what = f"{plain(mechanism.name)}: {p.name.replace('_', ' ')}{unit}"
            if mine:
                panels.append((what, name, mine, null_of(p) if k == 0 else None))
    columns = len(stiffness)
    lines = -(-len(panels) // columns)
    most = [max(len(shown) for _, _, shown, _ in panels[k : k + columns]) for k in range(0, len(panels), columns)]
    heights = [0.5 + 0.42 * count for count in most]
    figure = new_figure(max(5.4 * columns, 7.6), 1.3 + 1.15 * sum(heights))
    before = "Stiffness" if len(rows) == 1 else "Parameters before and after"
    caution = "" if found.verdict != "unexplained" else " (no model suits: don't rely on these)"
    title(figure, f"{before}, with 95 % intervals{caution}", subject, origin)
    grid = figure.subplots(lines, columns, squeeze=False, height_ratios=heights)
    for axes in grid.ravel()[len(panels) :]:
        axes.remove()
    for axes, (what, name, shown, null), letter in zip(
        grid.ravel(), panels, "ABCDEFGHIJKLMNOPQRSTUVWXYZ", strict=False
    ):
        _draw(axes, name, shown, null)
        panel(axes, letter, what)
    return figure


def _draw(axes: Axes, name: str, rows: list[EstimateRow], null: float | None) -> None:
    ends = [] if null is None else [null]
    for k, row in enumerate(rows):
        value = row.explanation.value(name)
        ends.append(value)
        seen = determined(row.explanation, name)
        if seen:
            low, high = row.explanation.interval(name)
            axes.plot([low, high], [k, k], color=row.colour, linewidth=2.2, solid_capstyle="butt")
            ends += [low, high]
        axes.plot(value, k, "o", color=row.colour, markersize=6, fillstyle="full" if seen else "none")
        ends_of = row.explanation.interval(name)
        text = number(value, (ends_of[1] - ends_of[0]) / 4 if seen else np.nan)
        if name in row.explanation.fit.at_bound:
            text += ", at the bound of the search"
        elif not seen:
            text += ", not seen by the data"
        axes.annotate(
            text,
            (value, k),
            (0, 7),
            textcoords="offset points",
            ha="center",
            fontsize=9,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8},
        )
    if null is not None:
        axes.axvline(null, color=DATA_COLOUR, linewidth=0.8, linestyle=":")
    if len(rows) > 1 and not rows[0].explanation.fit.mechanisms:
        axes.axvline(rows[0].explanation.value(name), color=BASE_COLOUR, linewidth=0.8, linestyle=":")
    span = max(ends) - min(ends) or abs(max(ends)) or 1.0
    axes.set_xlim(min(ends) - 0.25 * span, max(ends) + 0.25 * span)
    several = len(rows) > 1 or not rows[0].explanation.fit.mechanisms
    names = [row.model.replace(" + ", "\n+ ").replace(" (", "\n(") for row in rows]
    axes.set_yticks(range(len(rows)) if several else [], names if several else [])
    axes.set_ylim(len(rows) - 0.45, -0.8)

"""The response surface as in the paper's Fig. 5."""

from pathlib import Path
from typing import cast

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.container import BarContainer

from legfem.report.style import FAINT, panel, save, styled, titled
from legfem.report.words import TOLD
from legfem.study.doe.design import Factor
from legfem.study.doe.study import StudyResult
from legfem.study.doe.surface import MetricAnalysis, term_label

RESPONSE = "response"
"""Name of the response surface's figure."""
STAGE_COLOURS = ("#56B4E9", "#E69F00", "#009E73", "#CC79A7", "#0072B2", "#D55E00")


@styled
def draw_response(result: StudyResult, out: Path) -> list[Path]:
    """Draw the paper's Fig. 5: the stages on the curves, and the coefficients by stage."""
    section = f"section of subject {result.subject.id} ({result.subject.origin})"
    figure = titled(14, 8, f"Response surface: {result.definition.title}", section, "simulated")
    grid = figure.add_gridspec(2, 3, height_ratios=[1, 1.5])
    _curves(figure.add_subplot(grid[:, 0]), result)
    for row, interactions in enumerate((False, True)):
        for column, kind in enumerate(("curvature", "slope")):
            axes = figure.add_subplot(grid[row, 1 + column])
            chosen = [a for a in result.analyses if a.metric.kind == kind]
            what = "interactions" if interactions else "main effects"
            panel(axes, "BCDE"[2 * row + column], f"mean {kind}: {what}")
            _bars(axes, chosen, result.definition.factors, interactions)
            if column > 0:  # the terms are those of the panel to the left
                axes.set_yticklabels([])
    figure.supxlabel(TOLD["coefficients"], fontsize=9)
    return save(figure, out, RESPONSE, svg=True)


def _curves(axes: Axes, result: StudyResult) -> None:
    panel(axes, "A", f"all {len(result.outcomes)} runs")
    for k, (start, end) in enumerate(result.definition.windows):
        colour = STAGE_COLOURS[k % len(STAGE_COLOURS)]
        axes.axvspan(start, end, color=colour, alpha=0.35, lw=0, label=f"{start:g} to {end:g} mm")
    for k, found in enumerate(result.outcomes):
        centre = k == len(result.outcomes) - 1
        for curve in found.curves:
            axes.plot(
                curve.displacement,
                curve.force,
                color="#111111" if centre else FAINT,
                lw=2 if centre else 0.6,
                label="centre" if centre else None,
                zorder=3 if centre else 2,
            )
        if not found.complete and found.reached > 0:
            axes.plot(found.reached, found.curve.force[-1], "x", color="#D55E00")
    axes.set_xlim(0, result.definition.depth)
    axes.set_ylim(0, None)
    axes.set_xlabel("displacement (mm)")
    axes.set_ylabel("force per length (N/mm)")
    axes.legend(loc="upper left")


def _bars(axes: Axes, analyses: list[MetricAnalysis], factors: tuple[Factor, ...], interactions: bool) -> None:
    if not analyses:
        axes.text(0.5, 0.5, "not estimable", ha="center", transform=axes.transAxes)
        return
    chosen = [[test for test in a.tests[1:] if test.is_interaction == interactions] for a in analyses]
    names = [term_label(test.term, factors) for test in chosen[0]]
    values = pd.DataFrame([[test.value for test in tests] for tests in chosen], columns=pd.Index(names)).T
    values.plot.barh(ax=axes, width=0.8, color=[STAGE_COLOURS[k % len(STAGE_COLOURS)] for k in values], legend=False)
    for bars, tests, analysis in zip(axes.containers, chosen, analyses, strict=True):
        beyond = analysis.lenth.beyond if analysis.lenth else ()
        marks = [("s" if test.significant else "") + ("L" if test.term in beyond else "") for test in tests]
        axes.bar_label(cast(BarContainer, bars), marks, padding=3, fontsize=7)
    axes.axvline(0, color="#111111", lw=0.8)
    axes.tick_params(axis="y", labelsize=8)
    axes.invert_yaxis()
    axes.margins(x=0.12)
    axes.ticklabel_format(axis="x", scilimits=(-2, 2))
    axes.set_xlabel(f"coefficient ({analyses[0].metric.typeset_unit})")

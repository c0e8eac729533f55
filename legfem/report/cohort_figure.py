"""A cohort's numbers with their intervals, sorted, as a figure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from legfem.cohort.members import Member
from legfem.cohort.rows import Row, cohort_model, measured
from legfem.report.style import DATA_COLOUR, new_figure, styled

GROUP_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C6D1F", "#111111")
"""Okabe and Ito's, in an order in which neighbours differ."""


def colours_of(members: Sequence[Member]) -> dict[str, str]:
    """Colours of the groups, in the table's order; one for all where there are no groups."""
    groups = dict.fromkeys(str(one.given.get("group", "")) for one in members)
    return {group: GROUP_COLOURS[k % len(GROUP_COLOURS)] for k, group in enumerate(groups)}


@styled
def forest_figure(members: Sequence[Member], rows: Sequence[Row]) -> Figure:
    """Every parameter of all members, sorted, with 95 % intervals, coloured by group."""
    model, colours = cohort_model(rows), colours_of(members)
    group_of = {one.name: str(one.given.get("group", "")) for one in members}
    found = [(row, one.measures) for row, one in measured(rows, model)]
    names = list(dict.fromkeys(name for _, measures in found for name in measures))
    figure = new_figure(3.2 * max(len(names), 1), min(1.2 + 0.22 * len(found), 12.0))
    for axes, name in zip(np.atleast_1d(figure.subplots(1, max(len(names), 1))), names, strict=False):
        shown = sorted(((m[name], row) for row, m in found if name in m), key=lambda one: one[0].value)
        for place, (one, row) in enumerate(shown):
            colour = colours.get(group_of[row.member], DATA_COLOUR)
            if one.low is not None and one.high is not None:
                axes.plot([one.low, one.high], [place, place], color=colour, linewidth=1.2)
            axes.plot(one.value, place, "o", color=colour, markersize=4)
        axes.set_yticks(range(len(shown)), [row.name for _, row in shown] if len(shown) <= 40 else [""] * len(shown))
        axes.set_xlabel(f"{name} ({shown[0][0].unit})")
    return figure

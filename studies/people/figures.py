"""Figures: everyone's stiffness at a site with its interval, and compliance as predicted."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.report.style import DATA_COLOUR, FAINT, REGION_COLOURS, new_figure, panel, styled, title
from studies.people.data import SITES, Indentations
from studies.people.prediction import Predicted
from studies.people.springs import least_squares, left_out

_TISSUES = (("superficial", "skin and fat"), ("deep", "muscle"))


@styled
def draw_stiffness(rows: Indentations, log_C10: FloatArray, site: str) -> Figure:
    """Draw C10 of both tissues of everyone at a site, of draws (k, n, 2) of its logarithm."""
    figure = new_figure(9, 3.8)
    own = rows.site == rows.sites.index(site)
    title(
        figure,
        f"Stiffness at the {SITES[site]}, each person with a 95 % interval",
        f"{len(rows.people)} people",
        "measured",
    )
    for k, (axes, (region, name)) in enumerate(zip(figure.subplots(1, 2), _TISSUES, strict=True)):
        low, middle, high = mpa_to_kpa(np.exp(np.quantile(log_C10[:, own, k], (0.025, 0.5, 0.975), axis=0)))
        order = np.argsort(middle)
        at = np.arange(len(order))
        axes.vlines(at, low[order], high[order], color=REGION_COLOURS[region], lw=2.5)
        axes.plot(at, middle[order], ".", color=DATA_COLOUR, ms=4)
        axes.set(yscale="log", xlabel="people, by their median", ylabel="C10 (kPa)")
        panel(axes, "AB"[k], name)
    return figure


@styled
def draw_predicted(rows: Indentations, compliance: FloatArray, predicted: Predicted) -> Figure:
    """Draw compliance as measured against that of mechanics and of springs, all left out."""
    figure = new_figure(9, 4.6)
    title(
        figure, "Compliance of people left out of the fit, by thickness alone", f"{len(rows.people)} people", "measured"
    )
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    _against(left, rows, compliance, predicted.best)
    panel(left, "A", "mechanics")
    _against(right, rows, compliance, left_out(rows, compliance, least_squares))
    panel(right, "B", "two linear springs by site")
    right.legend(fontsize=8, markerscale=1.5)
    return figure


def _against(axes: Axes, rows: Indentations, compliance: FloatArray, predicted: FloatArray) -> None:
    ends = np.quantile(compliance, (0.0, 1.0))
    axes.plot(ends, ends, color=FAINT, lw=0.8)
    for k, site in enumerate(rows.sites):
        own = rows.site == k
        axes.plot(predicted[own], compliance[own], "osv^Dp*X"[k], ms=3, alpha=0.7, label=SITES[site])
    axes.set(xscale="log", yscale="log", xlabel="predicted (mm/MPa)", ylabel="measured (mm/MPa)")

"""Figure of fit and residual, as the paper's Fig. 7: a panel a law and site."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from legfem.common.units import FloatArray
from legfem.data import LoadingCurve
from legfem.inverse.catalogue import LawName, symbol_of
from legfem.inverse.estimates import Estimate
from legfem.inverse.fit import Fit, TestFit
from legfem.legs.details import LegDetails
from legfem.legs.notices import curve_of
from legfem.report.style import DATA_COLOUR, FAINT, LAW_COLOURS, LAW_NAMES, new_figure, panel, styled, title


@styled
def fit_figure(fits: Sequence[Fit[LegDetails]]) -> Figure:
    """Measured and simulated force over displacement, and their difference beneath: a panel a law and site.

    Parameters
    ----------
    fits
        One a law, of one leg; panels stand in their order.
    """
    first = fits[0]
    panels = [(fit, number) for fit in fits for number in range(len(fit.tests))]
    several = len(first.tests) > 1
    figure = new_figure((4.6 if several else 5.2) * len(panels) + 0.6, 6.4)
    together = " of all sites together" if several else ""
    title(figure, f"Measured and simulated force{together}", first.subject.title, first.subject.origin)
    grid = figure.subplots(2, len(panels), sharex=not several, squeeze=False, height_ratios=(2.2, 1))
    top = 1.05 * max(_highest(one) for fit in fits for one in fit.tests)
    for column, (fit, number) in enumerate(panels):
        above, below = grid[:, column]
        one = fit.tests[number]
        measured, force = curve_of(one), one.force.predicted
        lines = [f"rms {one.force.rms:.3g} N"]
        if not several:
            lines = [f"cost E = {fit.cost.value:.3g} N$^2$, {lines[0]}"]
        if number == 0:
            lines = [*estimate_lines(fit.estimates), *lines]
        draw_fit(above, measured, force, fit.law, lines)
        above.set_ylim(0, None if several else top)
        panel(above, chr(ord("A") + column), f"{one.name}, {LAW_NAMES[fit.law]}" if several else LAW_NAMES[fit.law])
        draw_residual(below, measured, force, fit.law)
        below.set_xlim(*above.get_xlim())
    label_axes(grid)
    return figure


def label_axes(grid: Any) -> None:
    """Name the axes of panels (2, n): forces above, differences beneath."""
    for below in grid[1]:
        below.set_xlabel("displacement of the indenter after first contact (mm)")
    grid[0, 0].set_ylabel("force (N)")
    grid[1, 0].set_ylabel("simulated − measured (N)\non each panel's own scale")


def estimate_lines(parameters: Mapping[str, Estimate]) -> list[str]:
    """Return a line a parameter: value and interval."""
    shown = {symbol_of(name): found.shown for name, found in parameters.items()}
    return [
        f"{symbol} = {one.value:.3g} {one.unit} [{one.ci95[0]:.3g}, {one.ci95[1]:.3g}]" for symbol, one in shown.items()
    ]


def _highest(one: TestFit) -> float:
    return float(max(curve_of(one).trial_force.max(), one.force.predicted.max()))


def draw_fit(axes: Axes, measured: LoadingCurve, predicted: FloatArray, law: LawName, lines: Sequence[str]) -> None:
    """Draw a measured curve, its trials and what the model predicts (n,), N, with some lines."""
    depth, force, error = measured.displacement, measured.force, measured.force_sd
    trials = axes.plot(depth, measured.trial_force.T, color=FAINT, linewidth=0.6, alpha=0.8)
    band = axes.fill_between(depth, force - 2 * error, force + 2 * error, color=FAINT, alpha=0.35, linewidth=0)
    every = max(1, len(depth) // 40)
    (mean,) = axes.plot(depth[::every], force[::every], "o", color=DATA_COLOUR, markersize=3.2, fillstyle="none")
    (model,) = axes.plot(depth, predicted, color=LAW_COLOURS[law], linewidth=1.8)
    many = measured.n_trials > 1
    axes.legend(
        [mean, band, *([trials[0]] if many else []), model],
        [
            f"mean of {measured.n_trials} trials" if many else "the one trial",
            "± 2 standard errors",
            *(["each trial"] if many else []),
            f"model, {LAW_NAMES[law]}",
        ],
        loc="upper left",
    )
    axes.text(0.98, 0.04, "\n".join(lines), transform=axes.transAxes, ha="right", va="bottom")
    axes.set_xlim(0, 1.02 * depth[-1])


def draw_residual(axes: Axes, measured: LoadingCurve, predicted: FloatArray, law: LawName) -> None:
    """Draw what the model predicts (n,), N, less what was measured."""
    depth, error = measured.displacement, measured.force_sd
    axes.fill_between(depth, -2 * error, 2 * error, color=FAINT, alpha=0.35, linewidth=0)
    axes.axhline(0.0, color=DATA_COLOUR, linewidth=0.6)
    if measured.n_trials > 1:
        apart = predicted[:, None] - measured.trial_force.T
        axes.plot(depth, apart, color=FAINT, linewidth=0.6, alpha=0.8)
    axes.plot(depth, predicted - measured.force, color=LAW_COLOURS[law], linewidth=1.6)

"""The figure of a fit's cost over its parameters, with the search's path."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import matplotlib.patheffects as outline
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from scipy.special import chdtri

from legfem.common.units import FloatArray, readable_unit
from legfem.inverse.estimates import Shown
from legfem.inverse.fit import Fit
from legfem.legs.details import LegDetails
from legfem.report.style import LAW_COLOURS, LAW_NAMES, new_figure, panel, styled, title

_NEARLY_ZERO = 0.1
"""kPa: below, a logarithmic axis that holds 0 goes on linearly to it."""


def draw_contours(figure: Figure, axes: Axes, x: FloatArray, y: FloatArray, cost: FloatArray) -> None:
    """Draw contours of a cost (k, m), N2, with its colour bar."""
    low, high = np.log10(np.nanmin(cost)), np.log10(np.nanmax(cost))
    levels = np.logspace(low, high, 16)
    image = axes.contourf(x, y, cost, levels=levels, norm=LogNorm(), cmap="viridis_r", alpha=0.85)
    axes.contour(x, y, cost, levels=levels, norm=LogNorm(), colors="white", linewidths=0.3)
    bar = figure.colorbar(image, ax=axes, shrink=0.9)
    bar.set_label("cost E (N$^2$)")
    ticks = _round_numbers(levels[0], levels[-1])
    bar.set_ticks(ticks, labels=[_short(tick) for tick in ticks])
    bar.minorticks_off()


def _round_numbers(low: float, high: float) -> list[float]:
    """Return round numbers between two bounds, evenly spread on a logarithmic scale."""
    powers = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    steps = (1, 1.5, 2, 3, 5, 7) if len(powers) < 4 else (1, 2, 5) if len(powers) < 5 else (1,)
    inside = [k * 10.0**p for p in powers for k in steps if low <= k * 10.0**p <= high]
    return inside if len(inside) > 1 else [low, high]


def _short(value: float) -> str:
    if 1e-3 <= value < 1e4:
        return f"{value:g}"
    return f"$10^{{{round(np.log10(value))}}}$"


def follow_grid(axes: Axes, which: Literal["x", "y"], values: FloatArray) -> None:
    """Give an axis the limits of a grid, and its spacing: even, or even on logarithmic axes."""
    steps = np.diff(values)
    axis, limits = (axes.xaxis, axes.set_xlim) if which == "x" else (axes.yaxis, axes.set_ylim)
    if len(values) > 3 and steps.max() > 1.5 * steps.min():
        setter = axes.set_xscale if which == "x" else axes.set_yscale
        if which == "x":
            setter("log")
        else:
            setter("symlog", linthresh=_NEARLY_ZERO, linscale=0.6)
        powers = np.floor(np.log10(max(values[0], _NEARLY_ZERO))), np.ceil(np.log10(values[-1]))
        decades = 10.0 ** np.arange(powers[0], powers[1] + 1)
        ticks = np.outer(decades, (1, 2, 5)).ravel()
        axis.set_major_locator(FixedLocator([*([] if which == "x" else [0.0]), *ticks]))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_locator(NullLocator())
    limits(values[0], values[-1])


_STAGES = {
    "design": ("s", "first design"),
    "proposal": ("o", "proposed by the emulator"),
    "bound": ("^", "check at a bound"),
    "genetic": ("D", "of the genetic algorithm"),
}
_TISSUES = ("deep", "superficial")
_BEST, _GENETIC = "#D55E00", "#CC79A7"
_HALO = [outline.withStroke(linewidth=2.2, foreground="white")]
_CROWDED = 12.0
"""Dots between two points below which their numbers would overlap."""


@dataclass(frozen=True, eq=False)
class _Axis:
    """One parameter as it is drawn."""

    name: str
    found: Shown
    factor: float
    """From the model's unit to the one drawn."""

    @property
    def label(self) -> str:
        term, _, symbol = self.name.rpartition(".")
        own = f"the {term} tissue" if term in _TISSUES else f"the {term}"
        return f"{symbol} of {own} ({self.found.unit})"

    def of(self, values: Mapping[str, float]) -> float:
        return self.factor * values.get(self.name, math.nan)


def _axes(result: Fit[LegDetails]) -> list[_Axis]:
    return [_Axis(name, found.shown, readable_unit(found.unit)[1]) for name, found in result.estimates.items()]


@styled
def cost_figure(result: Fit[LegDetails]) -> Figure:
    """Return the cost over the whole search and near the optimum, of one or two parameters.

    A map over two parameters, a curve over one. The whole search comes from the emulator; near the
    optimum the simulated force is linear in the parameters, with the sensitivities of the last full
    solve.
    """
    figure = new_figure(11.5, 5.4)
    name = f"Cost of the {LAW_NAMES[result.law]} law over its parameters"
    title(figure, name, result.subject.title, result.subject.origin)
    whole, near = figure.subplots(1, 2)
    panel(whole, "A", "the whole search")
    panel(near, "B", "near the optimum (force linear in the parameters)")
    if len(result.estimates) == 2:
        _draw_map(figure, whole, near, result)
    else:
        _draw_curve(whole, near, result)
    handles, labels = _legend(result)
    figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure


def confidence_ellipse(result: Fit[LegDetails]) -> FloatArray:
    """Return the outline (n, 2) of two parameters' joint 95 % region, in the units drawn (kPa).

    From standard errors and correlation, hence symmetric: C20 may come out negative.
    """
    first, second = (axis.found for axis in _axes(result))
    correlation = float(np.clip(np.nan_to_num(result.correlations[0, 1]), -1.0, 1.0))
    covariance = np.diag([first.standard_error**2, second.standard_error**2])
    covariance[0, 1] = covariance[1, 0] = correlation * first.standard_error * second.standard_error
    values, axes = np.linalg.eigh(covariance)
    angle = np.linspace(0, 2 * np.pi, 200)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    half = np.sqrt(np.maximum(values, 0.0) * chdtri(2, 1 - 0.95))
    region = np.array([first.value, second.value]) + circle * half @ axes.T
    # The first may stand on a logarithmic axis.
    if first.value > 0:
        region[:, 0] = np.maximum(region[:, 0], 1e-3 * first.value)
    return region


def linear_cost(result: Fit[LegDetails], *values: FloatArray) -> FloatArray:
    """Return the cost (N2) with the force linear in the parameters about the optimum.

    Parameters
    ----------
    result
        Gives the force and its sensitivities at the optimum.
    *values
        Of each parameter, of one shape, in the units drawn (kPa).
    """
    change: Any = 0.0
    for axis, at in zip(_axes(result), values, strict=True):
        rate = np.concatenate([one.force.sensitivities[axis.name] for one in result.tests]) / axis.factor
        change = change + (at - axis.found.value)[..., None] * rate
    return np.asarray(np.sum((np.concatenate([one.force.residual for one in result.tests]) + change) ** 2, axis=-1))


def _draw_map(figure: Figure, whole: Axes, near: Axes, result: Fit[LegDetails]) -> None:
    region = confidence_ellipse(result)
    first, second = _axes(result)
    known = result.log.cost_map
    if known is not None:
        across, up = first.factor * known.across, second.factor * known.up
        draw_contours(figure, whole, across, up, np.maximum(known.cost, 1e-12))
    # The window holds the region and what of the search is close by.
    low, high = region.min(axis=0), region.max(axis=0)
    margin = 0.75 * (high - low) + 1e-3 * np.abs(high)
    low, high = low - margin, high + margin
    least = [one.parameter.bounds[0] for one in result.estimates.values()]
    low = np.maximum(low, [0.0 if bound >= 0 else -np.inf for bound in least])
    x, y = np.linspace(low[0], high[0], 120), np.linspace(low[1], high[1], 120)
    draw_contours(figure, near, x, y, linear_cost(result, *np.meshgrid(x, y)))
    near.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    near.locator_params(nbins=6)
    if known is not None:
        follow_grid(whole, "x", across)
        follow_grid(whole, "y", up)
    path = [(first.of(g.values), second.of(g.values)) for g in result.log.generations]
    best = np.array(path).reshape(-1, 2)
    for axes in (whole, near):
        axes.plot(*best.T, color=_GENETIC, linewidth=1.2, marker=".", markersize=5)
        axes.fill(*region.T, facecolor="none", edgecolor=_BEST, linewidth=1.6, zorder=4)
        axes.plot(
            first.found.value, second.found.value, "*", color=_BEST, markersize=13, markeredgecolor="white", zorder=6
        )
        axes.set_xlabel(first.label)
        axes.set_ylabel(second.label)
        places = [(first.of(s.values), second.of(s.values)) for s in result.log.solves]
        _mark_solves(axes, result, places)


def _draw_curve(whole: Axes, near: Axes, result: Fit[LegDetails]) -> None:
    (axis,) = _axes(result)
    found, colour = axis.found, LAW_COLOURS[result.law]
    known = result.log.cost_map
    if known is not None:
        whole.plot(axis.factor * known.across, known.cost[0], color=colour)
        follow_grid(whole, "x", axis.factor * known.across)
    whole.set_yscale("log")
    low, high = found.ci95
    margin = 0.75 * (high - low) + 1e-3 * abs(high)
    least = next(iter(result.estimates.values())).parameter.bounds[0]
    x = np.linspace(max(low - margin, 0.0 if least >= 0 else -np.inf), high + margin, 200)
    near.plot(x, linear_cost(result, x), color=colour)
    near.set_xlim(x[0], x[-1])
    near.locator_params(nbins=6)
    near.set_ylim(*near.get_ylim())
    best = np.array([(axis.of(g.values), g.cost) for g in result.log.generations])
    for axes in (whole, near):
        axes.plot(*best.reshape(-1, 2).T, color=_GENETIC, linewidth=1.2, marker=".", markersize=5)
        axes.axvspan(*found.ci95, color=_BEST, alpha=0.2, linewidth=0)
        axes.plot(found.value, result.cost.value, "*", color=_BEST, markersize=13, markeredgecolor="white", zorder=6)
        axes.set_xlabel(axis.label)
        axes.set_ylabel("cost E (N$^2$)")
        places = [(axis.of(solve.values), solve.cost) for solve in result.log.solves]
        _mark_solves(axes, result, places)


def _mark_solves(axes: Axes, result: Fit[LegDetails], places: list[tuple[float, float]]) -> None:
    """Draw the full solves with their numbers; those too close together share a label."""
    axes.set(xlim=axes.get_xlim(), ylim=axes.get_ylim())
    frame = axes.get_window_extent()
    labels: list[tuple[FloatArray, FloatArray, list[int]]] = []
    for number, (solve, where) in enumerate(zip(result.log.solves, places, strict=True), start=1):
        marker = _STAGES[solve.stage][0] if solve.complete else "x"
        at = np.array(where)
        seen = axes.transData.transform(at)
        if not (np.isfinite(seen).all() and frame.padded(1.0).contains(*seen)):
            continue
        axes.plot(
            *at, marker, color="black", markersize=6, fillstyle="none", zorder=5, path_effects=_HALO, clip_on=False
        )
        for _, label, numbers in labels:
            if np.linalg.norm(seen - label) < _CROWDED:
                numbers.append(number)
                break
        else:
            labels.append((at, seen, [number]))
    for at, place, numbers in labels:
        # Inside the frame: to the lower left of points at its upper or right edge.
        right, top = frame.x1 - place[0] < 40, frame.y1 - place[1] < 25
        axes.annotate(
            _ranges(numbers),
            (at[0], at[1]),
            xytext=(-6 if right else 6, -6 if top else 5),
            textcoords="offset points",
            ha="right" if right else "left",
            va="top" if top else "bottom",
            fontsize=8,
            path_effects=_HALO,
            zorder=7,
        )


def _ranges(numbers: list[int]) -> str:
    """Return ``1-3, 7`` for 1, 2, 3, 7."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(f"{r[0]}–{r[-1]}" if len(r) > 1 else str(r[0]) for r in runs)


def _legend(result: Fit[LegDetails]) -> tuple[list[Any], list[str]]:
    def point(marker: str) -> Line2D:
        return Line2D([], [], marker=marker, color="black", linestyle="", fillstyle="none")

    used = {solve.stage for solve in result.log.solves if solve.complete}
    entries: list[tuple[Any, str]] = [
        (point(marker), f"full solve, {what}") for stage, (marker, what) in _STAGES.items() if stage in used
    ]
    if any(not solve.complete for solve in result.log.solves):
        entries.append((point("x"), "full solve that stopped short"))
    if result.log.generations:
        entries.append(
            (
                Line2D([], [], color=_GENETIC, marker="."),
                "best of each generation" + (" (emulator)" if result.log.cost_map else ""),
            )
        )
    two = len(result.estimates) == 2
    entries.append((Line2D([], [], marker="*", color=_BEST, linestyle="", markersize=11), "optimum"))
    entries.append(
        (Line2D([], [], color=_BEST), "joint 95 % region") if two else (Patch(color=_BEST, alpha=0.2), "95 % interval")
    )
    handles, labels = zip(*entries, strict=True)
    return list(handles), list(labels)

"""Figure of the cost over the parameters, with the search's path and the optimum's region."""

from __future__ import annotations

from typing import Any, Literal

import matplotlib.patheffects as outline
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from scipy.stats import chi2

from legfem.identify.result import IdentificationResult
from legfem.report.style import LAW_COLOURS, LAW_NAMES, new_figure, panel, styled, title
from legfem.units import FloatArray

_STAGES = {
    "design": ("s", "first design"),
    "proposal": ("o", "proposed by the emulator"),
    "bound": ("^", "check at a bound"),
    "genetic": ("D", "of the genetic algorithm"),
}
_BEST, _GENETIC = "#D55E00", "#CC79A7"
_HALO = [outline.withStroke(linewidth=2.2, foreground="white")]
_C20_LINEAR = 0.1
"""kPa: below, a logarithmic axis of C20 goes on linearly to zero."""
_CROWDED = 12.0
"""Dots between two points below which their numbers would overlap."""


@styled
def cost_figure(result: IdentificationResult) -> Figure:
    """Return the cost over the whole search and near the optimum.

    For the reduced polynomial a map over C10 and C20, for neo-Hookean a curve over C10. The whole
    search comes from the emulator; near the optimum the simulated force is linear in the
    parameters, with the sensitivities of the last full solve.
    """
    figure = new_figure(11.5, 5.4)
    name = f"Cost of the {LAW_NAMES[result.law]} law over its parameters"
    title(figure, name, result.subject_title, result.subject_origin)
    whole, near = figure.subplots(1, 2)
    panel(whole, "A", "the whole search")
    panel(near, "B", "near the optimum (force linear in the parameters)")
    if "c20_deep" in result.parameters:
        _draw_map(figure, whole, near, result)
    else:
        _draw_curve(whole, near, result)
    handles, labels = _legend(result)
    figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure


def confidence_ellipse(result: IdentificationResult, level: float = 0.95) -> FloatArray:
    """Return the outline (n, 2), kPa, of the joint region of C10 and C20.

    From standard errors and correlation, hence symmetric: C20 may come out negative.
    """
    c10, c20 = result.parameters["c10_deep"], result.parameters["c20_deep"]
    correlation = float(np.clip(np.nan_to_num(result.correlation), -1.0, 1.0))
    covariance = np.diag([c10.standard_error**2, c20.standard_error**2])
    covariance[0, 1] = covariance[1, 0] = correlation * c10.standard_error * c20.standard_error
    values, axes = np.linalg.eigh(covariance)
    angle = np.linspace(0, 2 * np.pi, 200)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    half = np.sqrt(np.maximum(values, 0.0) * chi2.ppf(level, 2))
    region = np.array([c10.value, c20.value]) + circle * half @ axes.T
    # C10 may stand on a logarithmic axis.
    region[:, 0] = np.maximum(region[:, 0], 1e-3 * c10.value)
    return region


def linear_cost(result: IdentificationResult, c10: FloatArray, c20: FloatArray) -> FloatArray:
    """Return the cost (N2) with the force linear in the parameters about the optimum.

    Parameters
    ----------
    result
        Gives the force and its sensitivities at the optimum.
    c10, c20
        kPa, of one shape.
    """
    best10, best20 = _optimum(result)
    rates = result.predicted.sensitivities
    none = np.zeros_like(result.predicted.force)
    change = (
        (c10 - best10)[..., None] * rates["deep.C10"]
        + (c20 - best20)[..., None] * rates.get("deep.C20", none)
    )  # fmt: skip
    return np.asarray(np.sum((result.residual + change) ** 2, axis=-1))


def _optimum(result: IdentificationResult) -> tuple[float, float]:
    second = result.parameters.get("c20_deep")
    return result.parameters["c10_deep"].value, second.value if second else 0.0


def _draw_map(figure: Figure, whole: Axes, near: Axes, result: IdentificationResult) -> None:
    region = confidence_ellipse(result)
    known = result.search.cost_map
    if known is not None:
        cost = np.maximum(known.cost, 1e-12)
        _contours(figure, whole, known.c10, known.c20, cost)
    # The window holds the region and what of the search is close by.
    low, high = region.min(axis=0), region.max(axis=0)
    margin = 0.75 * (high - low) + 1e-3 * high
    low, high = np.maximum(low - margin, 0.0), high + margin
    c10, c20 = np.linspace(low[0], high[0], 120), np.linspace(low[1], high[1], 120)
    _contours(figure, near, c10, c20, linear_cost(result, *np.meshgrid(c10, c20)))
    near.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    near.locator_params(nbins=6)
    if known is not None:
        _scale(whole, "x", known.c10)
        _scale(whole, "y", known.c20)
    best = np.array([(g.c10, g.c20) for g in result.search.generations]).reshape(-1, 2)
    for axes in (whole, near):
        axes.plot(*best.T, color=_GENETIC, linewidth=1.2, marker=".", markersize=5)
        axes.fill(*region.T, facecolor="none", edgecolor=_BEST, linewidth=1.6, zorder=4)
        axes.plot(*_optimum(result), "*", color=_BEST, markersize=13, markeredgecolor="white",
                  zorder=6)  # fmt: skip
        axes.set_xlabel("C10 of the deep tissue (kPa)")
        axes.set_ylabel("C20 of the deep tissue (kPa)")
        _mark_solves(axes, result, [solve.c20 for solve in result.search.solves])


def _draw_curve(whole: Axes, near: Axes, result: IdentificationResult) -> None:
    found = result.parameters["c10_deep"]
    colour = LAW_COLOURS[result.law]
    known = result.search.cost_map
    if known is not None:
        whole.plot(known.c10, known.cost[0], color=colour)
        _scale(whole, "x", known.c10)
    whole.set_yscale("log")
    low, high = found.ci95
    margin = 0.75 * (high - low) + 1e-3 * high
    c10 = np.linspace(max(low - margin, 0.0), high + margin, 200)
    near.plot(c10, linear_cost(result, c10, np.zeros_like(c10)), color=colour)
    near.set_xlim(c10[0], c10[-1])
    near.locator_params(nbins=6)
    near.set_ylim(*near.get_ylim())
    best = np.array([(g.c10, g.cost) for g in result.search.generations]).reshape(-1, 2)
    for axes in (whole, near):
        axes.plot(*best.T, color=_GENETIC, linewidth=1.2, marker=".", markersize=5)
        axes.axvspan(*found.ci95, color=_BEST, alpha=0.2, linewidth=0)
        axes.plot(found.value, result.cost.value, "*", color=_BEST, markersize=13,
                  markeredgecolor="white", zorder=6)  # fmt: skip
        axes.set_xlabel("C10 of the deep tissue (kPa)")
        axes.set_ylabel("cost E (N$^2$)")
        _mark_solves(axes, result, [solve.cost for solve in result.search.solves])


def _contours(figure: Figure, axes: Axes, x: FloatArray, y: FloatArray, cost: FloatArray) -> None:
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


def _mark_solves(axes: Axes, result: IdentificationResult, heights: list[float]) -> None:
    """Draw the full solves with their numbers; those too close together share a label."""
    axes.set(xlim=axes.get_xlim(), ylim=axes.get_ylim())
    frame = axes.get_window_extent()
    labels: list[tuple[FloatArray, FloatArray, list[int]]] = []
    for number, (solve, height) in enumerate(
        zip(result.search.solves, heights, strict=True), start=1
    ):
        marker = _STAGES[solve.stage][0] if solve.complete else "x"
        at = np.array([solve.c10, height])
        seen = axes.transData.transform(at)
        if not (np.isfinite(seen).all() and frame.padded(1.0).contains(*seen)):
            continue
        axes.plot(
            *at, marker, color="black", markersize=6, fillstyle="none", zorder=5,
            path_effects=_HALO, clip_on=False,
        )  # fmt: skip
        for _, place, numbers in labels:
            if np.linalg.norm(seen - place) < _CROWDED:
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


def _scale(axes: Axes, which: Literal["x", "y"], values: FloatArray) -> None:
    """Give an axis the limits of a grid, and its spacing: even, or even on logarithmic axes."""
    steps = np.diff(values)
    axis, limits = (axes.xaxis, axes.set_xlim) if which == "x" else (axes.yaxis, axes.set_ylim)
    if len(values) > 3 and steps.max() > 1.5 * steps.min():
        setter = axes.set_xscale if which == "x" else axes.set_yscale
        if which == "x":
            setter("log")
        else:
            setter("symlog", linthresh=_C20_LINEAR, linscale=0.6)
        powers = np.floor(np.log10(max(values[0], _C20_LINEAR))), np.ceil(np.log10(values[-1]))
        decades = 10.0 ** np.arange(powers[0], powers[1] + 1)
        ticks = np.outer(decades, (1, 2, 5)).ravel()
        axis.set_major_locator(FixedLocator([*([] if which == "x" else [0.0]), *ticks]))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_locator(NullLocator())
    limits(values[0], values[-1])


def _legend(result: IdentificationResult) -> tuple[list[Any], list[str]]:
    def point(marker: str) -> Line2D:
        return Line2D([], [], marker=marker, color="black", linestyle="", fillstyle="none")

    used = {solve.stage for solve in result.search.solves if solve.complete}
    entries: list[tuple[Any, str]] = [
        (point(marker), f"full solve, {what}")
        for stage, (marker, what) in _STAGES.items()
        if stage in used
    ]
    if any(not solve.complete for solve in result.search.solves):
        entries.append((point("x"), "full solve that stopped short"))
    if result.search.generations:
        entries.append(
            (
                Line2D([], [], color=_GENETIC, marker="."),
                "best of each generation" + (" (emulator)" if result.search.cost_map else ""),
            )
        )
    two = "c20_deep" in result.parameters
    entries.append(
        (Line2D([], [], marker="*", color=_BEST, linestyle="", markersize=11), "optimum")
    )
    entries.append(
        (Line2D([], [], color=_BEST), "joint 95 % region")
        if two
        else (Patch(color=_BEST, alpha=0.2), "95 % interval")
    )
    handles, labels = zip(*entries, strict=True)
    return list(handles), list(labels)

"""Axes over which a cost is drawn: contours with round numbers, and grids' own spacing."""

from __future__ import annotations

from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from legfem.common.units import FloatArray

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

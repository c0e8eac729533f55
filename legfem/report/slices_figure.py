"""Outlines of a leg's slices, bare and in its stocking, before anything is solved."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from legfem.common.units import FloatArray
from legfem.geometry.slices import CONTOURS, SliceSet
from legfem.report.style import FAINT, new_figure, styled
from legfem.stockings.leg import StockingLeg


@styled
def slices_figure(leg: StockingLeg) -> Figure:
    """Return outlines at three of the heights that are compared, bare and in the stocking."""
    levels = leg.slices[:: len(leg.slices) // 2]
    figure = new_figure(7.4, 4.0)
    figure.suptitle(f"Bare and in its stocking: {leg.origin} data", x=0.01, ha="left")
    every = figure.subplots(1, len(levels), sharex=True, sharey=True)
    shapes = [("bare", leg.bare, FAINT)]
    if leg.compressed is not None:
        shapes.append(("in the stocking", leg.compressed, "#0072B2"))
    for name, shape, colour in shapes:
        low, high = shape.levels[0], shape.levels[-1]
        slices = SliceSet.of(shape, np.clip(levels, low, high))
        for number, axes in enumerate(every):
            outlines = [slices.contours(part)[number] for part in CONTOURS]
            _outlines(axes, outlines, name, colour)
    for axes, level in zip(every, levels, strict=True):
        axes.set_title(f"z = {level:.0f} mm", loc="center")
        axes.set_aspect("equal")
        axes.set_xlabel("x (mm)")
    every[0].set_ylabel("y (mm)")
    every[0].invert_yaxis()
    figure.legend(*every[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def _outlines(axes: Axes, outlines: Sequence[FloatArray], name: str, colour: str) -> None:
    for number, outline in enumerate(outlines):
        closed = np.vstack([outline, outline[:1]])
        axes.plot(*closed.T, color=colour, lw=1.2, label=name if number == 0 else None)

"""The slices that the identification compares: the leg scanned in its stocking, and simulated."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import LegShape
from legfem.geometry.slices import CONTOURS, SliceSet
from legfem.report.leg_directions import Directions, unwrapped
from legfem.report.style import DATA_COLOUR, new_figure, styled, title
from legfem.stockings.misfit import ContourMisfit
from legfem.stockings.result import StockingResult
from legfem.stockings.search import Identified, expected_rms

MODEL, BARE, BAND = "#0072B2", "#E69F00", "#BDBDBD"
SHORT = {"anterior": "ant.", "posterior": "post.", "medial": "med.", "lateral": "lat."}
NAMES = {"outer": "skin", "inner": "hull of the muscle"}


@styled
def stocking_contours_figure(result: StockingResult, found: Identified, simulated: LegShape) -> Figure:
    """Return outlines and distances of the best fit, slice by slice.

    Parameters
    ----------
    result
        Of a leg that was scanned in its stocking.
    found
        The fit that is shown.
    simulated
        Its shape.
    """
    leg, misfit = result.leg, result.misfit
    assert misfit is not None
    target = misfit.target
    fitted, bare = (_rounds(misfit, found, shape) for shape in (simulated, leg.bare))
    figure = new_figure(3.0 * len(target.levels) + 0.6, 9.4)
    title(figure, "Contours that were compared: model of the compressed leg against its scan", leg.title, leg.origin)
    axes = figure.subplots(3, len(target.levels), sharey="row", height_ratios=(1.35, 1, 1))
    sides, words = Directions.of(leg.bare).sides()
    names = [SHORT.get(word, word) for word in words]
    slices = {
        "scan": (target, DATA_COLOUR, "-", 2.2),
        "bare": (SliceSet.of(leg.bare, target.levels), BARE, "-", 1.0),
        "model": (SliceSet.of(simulated, target.levels), MODEL, "-", 1.0),
    }
    error = 1.96 * expected_rms(leg.accuracy)
    reach = 1.05 * max(error, *(float(np.abs(d[c]).max()) for d in (fitted, bare) for c in d))
    for column, level in enumerate(target.levels):
        top = axes[0, column]
        _outlines(top, slices, column)
        top.set_title(f"z = {level:.1f} mm", loc="center")
        for row, name in enumerate(CONTOURS, 1):
            panel = axes[row, column]
            _distances(panel, target, name, column, (bare, fitted), error)
            panel.set(xlim=(-180, 180), ylim=(-reach, reach))
            panel.set_xticks(sides, names if row == 2 else [""] * len(names))
            for label, side in zip(panel.get_xticklabels(), ("left", *3 * ["center"], "right"), strict=True):
                label.set_horizontalalignment(side)
            rms = float(np.sqrt(np.mean(fitted[name][column] ** 2)))
            panel.text(0.97, 0.04, f"rms {rms:.2f} mm", transform=panel.transAxes, ha="right", color=MODEL, fontsize=9)
    axes[0, 0].set_ylabel("y (mm), front at the top")
    for row, name in enumerate(CONTOURS, 1):
        axes[row, 0].set_ylabel(f"{NAMES[name]}:\ndistance outside the scan (mm)")
    handles = [
        Line2D([], [], color=DATA_COLOUR, linewidth=2.2, label="scan in the stocking"),
        Line2D([], [], color=MODEL, label="model, best fit"),
        Line2D([], [], color=BARE, label="bare leg: what the stocking did"),
        Patch(color=BAND, alpha=0.6, label=f"errors of the contours, 95 % (±{error:.2f} mm)"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure


def _rounds(misfit: ContourMisfit, found: Identified, shape: LegShape) -> dict[str, FloatArray]:
    """Return distances by contour, (n_slices, n_points), with the fit's rigid motion."""
    distances = misfit.distances(shape)
    if found.rigid is not None:
        distances = distances + misfit.rigid_slopes(shape) @ found.rigid
    shapes = [misfit.target.contours(name).shape[:2] for name in CONTOURS]
    parts = np.split(distances, [shapes[0][0] * shapes[0][1]])
    return {name: part.reshape(shape) for name, part, shape in zip(CONTOURS, parts, shapes, strict=True)}


def _outlines(axes: Axes, slices: dict[str, tuple[SliceSet, str, str, float]], column: int) -> None:
    for found, colour, style, width in slices.values():
        for name in CONTOURS:
            contour = found.contours(name)[column]
            axes.plot(*np.vstack([contour, contour[:1]]).T, color=colour, linestyle=style, linewidth=width)
    axes.set_aspect("equal")
    axes.set_xlabel("x (mm)")
    if column == 0:
        axes.invert_yaxis()


def _distances(
    axes: Axes,
    target: SliceSet,
    name: str,
    column: int,
    both: tuple[dict[str, FloatArray], dict[str, FloatArray]],
    error: float,
) -> None:
    angle = unwrapped(target.contours(name)[column : column + 1])[0]
    grid = np.linspace(-180, 180, 361)
    axes.axhspan(-error, error, color=BAND, alpha=0.6, linewidth=0)
    axes.axhline(0.0, color=DATA_COLOUR, linewidth=1.0)
    for found, colour in zip(both, (BARE, MODEL), strict=True):
        around = np.interp(grid, angle, found[name][column], period=360.0)
        axes.plot(grid, around, color=colour, linewidth=1.3)

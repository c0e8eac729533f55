"""The stocking's pressure on the skin: unrolled, and on the leg from two sides."""

from __future__ import annotations

from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from legfem.common.units import FloatArray, mpa_to_mmhg
from legfem.geometry.leg_shape import SKIN
from legfem.report.leg_directions import Directions, unwrapped
from legfem.report.style import new_figure, panel, scale_in_kpa, styled, title
from legfem.stockings.result import StockingResult

COLOURS = "viridis"
BARE_COLOUR = "#D9D9D9"
NO_PRESSURE = 0.01
"""Of the greatest, below which there is none to speak of."""
_MAP_POINTS = 361


@styled
def stocking_pressure_figure(result: StockingResult) -> Figure:
    """Return the interface pressure of the worn stocking, in mmHg."""
    worn, leg = result.worn, result.leg
    pressure = mpa_to_mmhg(worn.load.pressure)
    norm = Normalize(0.0, float(pressure.max()))
    figure = new_figure(13.0, 6.0)
    title(
        figure,
        f"Pressure of the stocking on the skin: mean {mpa_to_mmhg(worn.load.mean_pressure):.0f} "
        f"mmHg, greatest {pressure.max():.0f} mmHg",
        leg.title,
        leg.origin,
    )
    grid = figure.add_gridspec(1, 3, width_ratios=(1.6, 1, 1))
    flat = figure.add_subplot(grid[0])
    directions = Directions.of(leg.bare)
    image = _unrolled(flat, worn.shape.levels, worn.shape.contours[SKIN], pressure, norm)
    flat.set_xticks(*directions.sides())
    flat.set(xlabel="round the leg, seen from outside", ylabel="height z (mm)", xlim=(-180, 180))
    for side in (-90, 0, 90):
        flat.axvline(side, color="white", linewidth=0.5, alpha=0.6)
    panel(flat, "A", "unrolled")
    handles: list[Any] = []
    if leg.compressed is not None:
        heights: dict[str, Any] = dict(marker="<", color="black", linestyle="")
        flat.plot(np.full(len(leg.slices), 184.0), leg.slices, clip_on=False, **heights)
        handles.append(Line2D([], [], label="slices that were compared with the scan", **heights))
    if (pressure < NO_PRESSURE * pressure.max()).any():
        handles.append(
            Patch(
                facecolor=BARE_COLOUR,
                edgecolor="#777777",
                hatch="///",
                linewidth=0.5,
                label="no pressure: the fabric spans a hollow or a flat",
            )
        )
    if handles:
        flat.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.1))
    for place, (letter, side, angle) in enumerate((("B", 0, -90), ("C", 2, 90)), 1):
        axes = figure.add_subplot(grid[place], projection="3d")
        _solid(axes, worn.shape.points(SKIN), pressure, norm, angle)
        panel(axes, letter, f"{directions.names[side]} view")
    bar = figure.colorbar(image, ax=figure.axes[1:], shrink=0.75, pad=0.04)
    bar.set_label("interface pressure (mmHg)")
    scale_in_kpa(bar, "left")
    return figure


def _unrolled(axes: Axes, levels: FloatArray, skin: FloatArray, pressure: FloatArray, norm: Normalize) -> Any:
    """Draw the pressure over the angle round the leg and the height."""
    angle = np.linspace(-180.0, 180.0, _MAP_POINTS)
    rows = np.stack(
        [np.interp(angle, around, value, period=360.0) for around, value in zip(unwrapped(skin), pressure, strict=True)]
    )
    image = axes.pcolormesh(angle, levels, rows, cmap=COLOURS, norm=norm, shading="gouraud", rasterized=True)
    least = NO_PRESSURE * float(pressure.max())
    axes.contourf(angle, levels, rows, levels=[-1.0, least], colors=[BARE_COLOUR])
    hatched = axes.contourf(angle, levels, rows, levels=[-1.0, least], colors="none", hatches=["//"])
    hatched.set_edgecolor("#777777")
    hatched.set_linewidth(0.0)
    apart = 5.0 if pressure.max() < 35.0 else 10.0
    drawn = np.arange(apart, pressure.max(), apart)
    lines = axes.contour(angle, levels, rows, levels=drawn, colors="white", linewidths=0.6)
    axes.clabel(lines, fmt="%g", fontsize=8)
    return image


def _solid(axes: Any, points: FloatArray, pressure: FloatArray, norm: Normalize, angle: float) -> None:
    """Draw the skin, closed, coloured by its pressure."""
    closed = np.concatenate([points, points[:, :1]], axis=1)
    values = np.concatenate([pressure, pressure[:, :1]], axis=1)
    faces = 0.25 * (values[:-1, :-1] + values[1:, :-1] + values[:-1, 1:] + values[1:, 1:])
    colours = matplotlib.colormaps[COLOURS](norm(faces))
    colours[faces < NO_PRESSURE * values.max()] = matplotlib.colors.to_rgba(BARE_COLOUR)
    axes.plot_surface(
        *np.moveaxis(closed, -1, 0),
        facecolors=colours,
        rstride=1,
        cstride=1,
        shade=False,
        linewidth=0,
        antialiased=False,
        rasterized=True,
    )
    axes.set_proj_type("ortho")
    axes.set_aspect("equal")
    axes.set_box_aspect(np.ptp(points.reshape(-1, 3), axis=0), zoom=1.5)
    axes.view_init(elev=0, azim=angle)
    axes.set_axis_off()

"""Figures of a leg in its stocking: pressures on it and inside it, and the contours that were compared."""

from typing import Any, Literal

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from legfem.common.units import FloatArray, mmhg_to_mpa, mpa_to_kpa, mpa_to_mmhg
from legfem.geometry.leg_shape import HULL, SKIN, LegShape
from legfem.geometry.section import outward_normals
from legfem.report.style import BONE_COLOUR, DATA_COLOUR, panel, styled, titled
from legfem.report.words import ROUND, Directions, round_leg, unwrapped
from legfem.stockings.details import StockingDetails
from legfem.stockings.pressures import SectionPressures

COLOURS = "viridis"
BARE_COLOUR = "#D9D9D9"
NO_PRESSURE = 0.01
"""Of the greatest, below which there is none to speak of."""


@styled
def stocking_pressure_figure(details: StockingDetails) -> Figure:
    """Return the interface pressure of the worn stocking, in mmHg."""
    worn, leg = details.equilibrium, details.leg
    pressure = mpa_to_mmhg(worn.load.pressure)
    norm = Normalize(0.0, float(pressure.max()))
    ends = f"mean {mpa_to_mmhg(worn.load.mean_pressure):.0f} mmHg, greatest {pressure.max():.0f} mmHg"
    figure = titled(13.0, 6.0, f"Pressure of the stocking on the skin: {ends}", leg.title, leg.origin)
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
        none = "no pressure: the fabric spans a hollow or a flat"
        handles.append(Patch(facecolor=BARE_COLOUR, edgecolor="#777777", hatch="///", linewidth=0.5, label=none))
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
    rows = np.stack([round_leg(*pair) for pair in zip(unwrapped(skin), pressure, strict=True)])
    image = axes.pcolormesh(ROUND, levels, rows, cmap=COLOURS, norm=norm, shading="gouraud", rasterized=True)
    least = NO_PRESSURE * float(pressure.max())
    axes.contourf(ROUND, levels, rows, levels=[-1.0, least], colors=[BARE_COLOUR])
    hatched = axes.contourf(ROUND, levels, rows, levels=[-1.0, least], colors="none", hatches=["//"])
    hatched.set_edgecolor("#777777")
    hatched.set_linewidth(0.0)
    apart = 5.0 if pressure.max() < 35.0 else 10.0
    drawn = np.arange(apart, pressure.max(), apart)
    lines = axes.contour(ROUND, levels, rows, levels=drawn, colors="white", linewidths=0.6)
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


BARE, WORN = "#8C8C8C", "#0072B2"
VEIN_COLOUR = "#D55E00"


@styled
def stocking_section_figure(details: StockingDetails, section: SectionPressures) -> Figure:
    """Return the pressure in a section, and the outlines before and after, with their load."""
    leg, level = details.leg, section.level
    figure = titled(13.0, 8.2, f"Inside the leg at mid calf (z = {level:.1f} mm)", leg.title, leg.origin)
    (inside, outside), below = figure.subplots(2, 2, height_ratios=(5, 1))
    _keys(below[0], _draw_pressure(figure, inside, details, section))
    panel(inside, "A", "hydrostatic pressure in fat and muscle")
    _keys(below[1], _draw_outlines(outside, details, level))
    panel(outside, "B", "before and in the stocking")
    names = Directions.of(leg.bare).names
    for axes in (inside, outside):
        axes.set_aspect("equal")
        # The front at the top, as a leg is drawn; the patient's left at the right.
        axes.set_xlabel("x (mm), to the patient's left")
        frame = dict(transform=axes.transAxes, color="#444444", ha="center", va="center")
        places = (0.5, 0.985), (0.985, 0.5), (0.5, 0.015), (0.015, 0.5)
        for name, place, turn in zip(names, places, (0, 270, 0, 90), strict=True):
            axes.text(*place, name, rotation=turn, fontsize=9, **frame)
        axes.invert_yaxis()
    inside.set_ylabel("y (mm), to the back")
    return figure


def _draw_pressure(figure: Figure, axes: Axes, details: StockingDetails, section: SectionPressures) -> list[Any]:
    """Draw the pressure and the veins; return what the keys are."""
    pressure = mpa_to_mmhg(section.pressure)
    low, high = np.nanpercentile(pressure, [0.5, 99.5])
    norm = Normalize(min(low, 0.0), high)
    image = axes.pcolormesh(section.x, section.y, pressure, cmap=COLOURS, norm=norm, shading="nearest", rasterized=True)
    bare = details.leg.bare
    for part in (SKIN, HULL):
        axes.plot(*_closed(bare.at(part, section.level)), color="black", linewidth=1.0)
    _draw_bones(axes, bare, section.level)
    _frame(axes, bare.at(SKIN, section.level))
    assert details.pressures is not None
    veins = []
    dot: dict[str, Any] = dict(marker="o", color=VEIN_COLOUR, markeredgecolor="white")
    for count, (vein, found) in enumerate(zip(details.leg.veins, details.pressures.at_veins, strict=True), 1):
        value = f"{mpa_to_mmhg(found):.1f} mmHg" if np.isfinite(found) else "not in the tissues"
        x, y, _ = map(float, vein.position)
        axes.plot(x, y, markersize=13, zorder=5, **dot)
        text: dict[str, Any] = dict(color="white", weight="bold", ha="center", va="center_baseline", fontsize=9)
        axes.annotate(f"{count}", (x, y), zorder=6, **text)
        label = f"{count}  {vein.name} veins: {value}"
        veins.append(Line2D([], [], linestyle="", markersize=8, label=label, **dot))
    bar = figure.colorbar(image, ax=axes, shrink=0.7, pad=0.02, extend="both", location="left")
    bar.set_label("hydrostatic pressure (mmHg), positive in compression")
    scale_in_kpa(bar, "right")
    mean = mpa_to_mmhg(details.pressures.mean_interface)
    if min(low, 0.0) < mean < high:
        bar.ax.axhline(mean, color="white", linewidth=3)
        bar.ax.axhline(mean, color="black", linewidth=1.5)
    return [
        Line2D([], [], color="black", linewidth=1.0, label="skin, and hull of the muscle (bare)"),
        Patch(facecolor=BONE_COLOUR, edgecolor="black", label="bone"),
        Line2D([], [], color="black", linewidth=1.5, label=f"on the scale: mean pressure on the skin, {mean:.1f} mmHg"),
        *veins,
    ]


def _draw_outlines(axes: Axes, details: StockingDetails, level: float) -> list[Any]:
    """Draw the outlines and the pressure on the skin; return what the keys are."""
    bare, worn = details.leg.bare, details.equilibrium.shape
    before, after = (shape.at(SKIN, level) for shape in (bare, worn))
    at = np.interp(level, bare.levels, np.arange(len(bare.levels)))
    below, share = int(at), at - int(at)
    rows = details.equilibrium.load.pressure[[below, min(below + 1, len(bare.levels) - 1)]]
    pressure = mpa_to_mmhg((1 - share) * rows[0] + share * rows[1])
    normal = outward_normals(after)
    scale = 0.25 * float(np.ptp(after, axis=0).max()) / max(float(pressure.max()), 1e-9)
    out = after + scale * pressure[:, None] * normal
    band = np.concatenate([_closed(out).T, _closed(after).T[::-1]])
    axes.fill(*band.T, color=WORN, alpha=0.2, linewidth=0)
    step = max(1, len(after) // 60)
    for tip, root in zip(out[::step], after[::step], strict=True):
        axes.plot(*np.stack([tip, root]).T, color=WORN, linewidth=0.6, alpha=0.8)
    for part in (SKIN, HULL):
        axes.plot(*_closed(bare.at(part, level)), color=BARE, linewidth=1.2, linestyle="--")
        axes.plot(*_closed(worn.at(part, level)), color=DATA_COLOUR, linewidth=1.2)
    _draw_bones(axes, bare, level)
    _frame(axes, out)
    moved = f"skin moved by up to {np.linalg.norm(after - before, axis=1).max():.1f} mm"
    return [
        Line2D([], [], color=BARE, linestyle="--", label="skin and hull, bare"),
        Line2D([], [], color=DATA_COLOUR, label=f"skin and hull in the stocking: {moved}"),
        Patch(facecolor=WORN, alpha=0.3, label=f"pressure on the skin, up to {pressure.max():.0f} mmHg here"),
    ]


def _keys(axes: Axes, handles: list[Any]) -> None:
    """Explain the panel above."""
    axes.axis("off")
    axes.legend(handles=handles, loc="upper center")


def _frame(axes: Axes, outermost: FloatArray) -> None:
    """Leave room for the names of the sides."""
    low, high = outermost.min(axis=0), outermost.max(axis=0)
    room = 0.08 * float((high - low).max())
    axes.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room))


def _draw_bones(axes: Axes, shape: LegShape, level: float) -> None:
    for name in shape.bones:
        contour = shape.at(name, level)
        axes.fill(*contour.T, facecolor=BONE_COLOUR, edgecolor="black", linewidth=0.8, zorder=3)
        axes.annotate(name, contour.mean(axis=0), ha="center", va="center", fontsize=8, zorder=4)


def _closed(contour: FloatArray) -> FloatArray:
    """Return x and y of a contour (n, 2) with its first point repeated, (2, n + 1)."""
    return np.vstack([contour, contour[:1]]).T


def scale_in_kpa(bar: Any, side: Literal["left", "right"]) -> None:
    """Add a scale in kPa to the other side of a colour bar in mmHg."""
    unit = mpa_to_kpa(mmhg_to_mpa(1.0))
    scale = bar.ax.secondary_yaxis(side, functions=(lambda p: np.asarray(p) * unit, lambda p: np.asarray(p) / unit))
    scale.set_ylabel("kPa")

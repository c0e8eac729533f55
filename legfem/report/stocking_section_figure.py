"""The hydrostatic pressure inside the leg at mid calf, with the veins, and what presses there."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from legfem.common.units import FloatArray, mpa_to_mmhg
from legfem.geometry.leg_shape import HULL, SKIN, LegShape
from legfem.report.leg_directions import Directions
from legfem.report.style import BONE_COLOUR, DATA_COLOUR, new_figure, panel, scale_in_kpa, styled, title
from legfem.stockings.pressures import SectionPressures
from legfem.stockings.result import StockingResult

BARE, WORN = "#8C8C8C", "#0072B2"
VEIN_COLOUR = "#D55E00"


@styled
def stocking_section_figure(result: StockingResult, section: SectionPressures) -> Figure:
    """Return the pressure in a section, and the outlines before and after, with their load."""
    assert result.pressures is not None
    leg, level = result.leg, section.level
    figure = new_figure(13.0, 8.2)
    title(figure, f"Inside the leg at mid calf (z = {level:.1f} mm)", leg.title, leg.origin)
    (inside, outside), below = figure.subplots(2, 2, height_ratios=(5, 1))
    _keys(below[0], _draw_pressure(figure, inside, result, section))
    panel(inside, "A", "hydrostatic pressure in fat and muscle")
    _keys(below[1], _draw_outlines(outside, result, level))
    panel(outside, "B", "before and in the stocking")
    names = Directions.of(leg.bare).names
    for axes in (inside, outside):
        axes.set_aspect("equal")
        # The front at the top, as a leg is drawn; the patient's left at the right.
        axes.set_xlabel("x (mm), to the patient's left")
        frame = dict(transform=axes.transAxes, color="#444444", ha="center", va="center")
        for name, place, turn in zip(
            names, ((0.5, 0.985), (0.985, 0.5), (0.5, 0.015), (0.015, 0.5)), (0, 270, 0, 90), strict=True
        ):
            axes.text(*place, name, rotation=turn, fontsize=9, **frame)
        axes.invert_yaxis()
    inside.set_ylabel("y (mm), to the back")
    return figure


def _draw_pressure(figure: Figure, axes: Axes, result: StockingResult, section: SectionPressures) -> list[Any]:
    """Draw the pressure and the veins; return what the keys are."""
    pressure = mpa_to_mmhg(section.pressure)
    low, high = np.nanpercentile(pressure, [0.5, 99.5])
    image = axes.pcolormesh(
        section.x,
        section.y,
        pressure,
        cmap="viridis",
        vmin=min(low, 0.0),
        vmax=high,
        shading="nearest",
        rasterized=True,
    )
    bare = result.leg.bare
    for part in (SKIN, HULL):
        axes.plot(*_closed(bare.at(part, section.level)), color="black", linewidth=1.0)
    _draw_bones(axes, bare, section.level)
    _frame(axes, bare.at(SKIN, section.level))
    assert result.pressures is not None
    veins = []
    dot: dict[str, Any] = dict(marker="o", color=VEIN_COLOUR, markeredgecolor="white")
    for number, (vein, found) in enumerate(zip(result.leg.veins, result.pressures.at_veins, strict=True), 1):
        value = f"{mpa_to_mmhg(found):.1f} mmHg" if np.isfinite(found) else "not in the tissues"
        x, y, _ = map(float, vein.position)
        axes.plot(x, y, markersize=13, zorder=5, **dot)
        axes.annotate(
            f"{number}", (x, y), color="white", weight="bold", ha="center", va="center_baseline", fontsize=9, zorder=6
        )
        label = f"{number}  {vein.name} veins: {value}"
        veins.append(Line2D([], [], linestyle="", markersize=8, label=label, **dot))
    bar = figure.colorbar(image, ax=axes, shrink=0.7, pad=0.02, extend="both", location="left")
    bar.set_label("hydrostatic pressure (mmHg), positive in compression")
    scale_in_kpa(bar, "right")
    mean = mpa_to_mmhg(result.pressures.mean_interface)
    if min(low, 0.0) < mean < high:
        bar.ax.axhline(mean, color="white", linewidth=3)
        bar.ax.axhline(mean, color="black", linewidth=1.5)
    handles = [
        Line2D([], [], color="black", linewidth=1.0, label="skin, and hull of the muscle (bare)"),
        Patch(facecolor=BONE_COLOUR, edgecolor="black", label="bone"),
        Line2D([], [], color="black", linewidth=1.5, label=f"on the scale: mean pressure on the skin, {mean:.1f} mmHg"),
        *veins,
    ]
    return handles


def _draw_outlines(axes: Axes, result: StockingResult, level: float) -> list[Any]:
    """Draw the outlines and the pressure on the skin; return what the keys are."""
    bare, worn = result.leg.bare, result.worn.shape
    before, after = (shape.at(SKIN, level) for shape in (bare, worn))
    number = np.interp(level, bare.levels, np.arange(len(bare.levels)))
    below, share = int(number), number - int(number)
    rows = result.worn.load.pressure[[below, min(below + 1, len(bare.levels) - 1)]]
    pressure = mpa_to_mmhg((1 - share) * rows[0] + share * rows[1])
    normal = _normals(after)
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
    moved = np.linalg.norm(after - before, axis=1)
    handles = [
        Line2D([], [], color=BARE, linestyle="--", label="skin and hull, bare"),
        Line2D(
            [], [], color=DATA_COLOUR, label=f"skin and hull in the stocking: skin moved by up to {moved.max():.1f} mm"
        ),
        Patch(facecolor=WORN, alpha=0.3, label=f"pressure on the skin, up to {pressure.max():.0f} mmHg here"),
    ]
    _frame(axes, out)
    return handles


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
    return np.vstack([contour, contour[:1]]).T


def _normals(contour: FloatArray) -> FloatArray:
    along = np.roll(contour, -1, axis=0) - np.roll(contour, 1, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return np.stack([along[:, 1], -along[:, 0]], axis=1)

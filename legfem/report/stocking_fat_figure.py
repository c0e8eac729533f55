"""Fat thickness round the leg against the pressures over it and in it."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from legfem.common.units import mpa_to_mmhg
from legfem.report.leg_directions import Directions, unwrapped
from legfem.report.style import DATA_COLOUR, FAINT, REGION_COLOURS, new_figure, panel, styled, title
from legfem.report.words import number
from legfem.stockings.pressures import FatPressures
from legfem.stockings.result import StockingResult

INTERFACE, GREATEST = "#0072B2", "#D55E00"


@styled
def stocking_fat_figure(result: StockingResult, fat: FatPressures, level: float) -> Figure:
    """Return thickness and pressures round the leg at a level (mm), and over all levels."""
    leg = result.leg
    row = int(np.argmin(np.abs(fat.levels - level)))
    figure = new_figure(13.5, 5.4)
    title(figure, "Fat thickness and the pressures over it and in it", leg.title, leg.origin)
    around, by_thickness, by_interface = figure.subplots(1, 3, width_ratios=(1.5, 1, 1))

    angles = unwrapped(fat.skin)
    grid = np.linspace(-180, 180, 361)

    def at_level(values: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
        return np.interp(grid, angles[row], values[row], period=360.0)

    thick = around.twinx()
    thick.fill_between(grid, at_level(fat.thickness), color=REGION_COLOURS["superficial"])
    thick.set_ylim(0, 2.2 * fat.thickness[row].max())
    thick.set_ylabel("fat thickness (mm), shaded")
    thick.spines["right"].set_visible(True)
    around.set_zorder(thick.get_zorder() + 1)
    around.patch.set_visible(False)
    around.plot(
        grid,
        at_level(mpa_to_mmhg(fat.greatest)),
        color=GREATEST,
        linewidth=1.6,
        label="hydrostatic in the fat, greatest in its depth",
    )
    around.plot(
        grid,
        at_level(mpa_to_mmhg(fat.mean)),
        color=GREATEST,
        linewidth=1.2,
        linestyle="--",
        label="hydrostatic in the fat, mean over its depth",
    )
    around.plot(
        grid, at_level(mpa_to_mmhg(fat.interface)), color=INTERFACE, linewidth=1.6, linestyle="-.", label="on the skin"
    )
    around.set(xlim=(-180, 180), ylabel="pressure (mmHg)")
    around.set_ylim(0.0, 1.3 * around.get_ylim()[1])
    around.set_xticks(*Directions.of(leg.bare).sides())
    around.legend(loc="upper left")
    panel(around, "A", f"round the leg at z = {fat.levels[row]:.1f} mm")

    greatest, interface = mpa_to_mmhg(fat.greatest).ravel(), mpa_to_mmhg(fat.interface).ravel()
    thickness = fat.thickness.ravel()
    dots = dict(s=6, linewidths=0)
    image = by_thickness.scatter(thickness, greatest, c=interface, cmap="viridis", **dots)
    bar = figure.colorbar(image, ax=by_thickness, location="bottom", shrink=0.9)
    bar.set_label("pressure on the skin there (mmHg)")
    by_thickness.set(
        xlabel="fat thickness (mm)", xlim=(0, None), ylabel="greatest hydrostatic pressure\nin the fat (mmHg)"
    )
    panel(
        by_thickness, "B", f"all columns: rank correlation {number(fat.rank_correlation(fat.greatest, fat.thickness))}"
    )
    image = by_interface.scatter(interface, greatest, c=thickness, cmap="cividis", **dots)
    bar = figure.colorbar(image, ax=by_interface, location="bottom", shrink=0.9)
    bar.set_label("fat thickness there (mm)")
    low, top = 0.95 * float(np.nanmin(greatest)), 1.05 * float(np.nanmax(greatest))
    by_interface.plot([low, top], [low, top], color=FAINT, linewidth=0.8, zorder=0)
    by_interface.annotate("alike ", (top, top), color=FAINT, ha="right", va="top")
    by_interface.set(xlabel="pressure on the skin (mmHg)")
    for axes in (by_thickness, by_interface):
        axes.set_ylim(low, top)
    panel(
        by_interface, "C", f"all columns: rank correlation {number(fat.rank_correlation(fat.greatest, fat.interface))}"
    )
    mean = mpa_to_mmhg(result.worn.load.mean_pressure)
    for axes in (by_thickness, by_interface):
        axes.axhline(mean, color=DATA_COLOUR, linewidth=0.8, linestyle=":")
    by_thickness.annotate("mean on the skin", (0.1, mean), va="top", fontsize=8)
    return figure

"""Fig. 4 of Frauziols et al.: both models of the idealised leg, the pressure on its skin, and P(d)."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.tri import Triangulation

from legfem.common.units import FloatArray
from legfem.report.style import FAINT, REGION_COLOURS, new_figure, panel, save, styled
from legfem.study.correction.calibration import Calibrated
from legfem.study.correction.cases import CorrectionCase
from legfem.study.correction.command import COLOURS


@styled
def draw_correction(case: CorrectionCase, found: Calibrated, lengths: dict[str, FloatArray], out: Path) -> list[Path]:
    """Draw the models, the pressure along and across the cylinder, and P(d)."""
    figure = new_figure(13, 7.5)
    grid = figure.add_gridspec(2, 3, width_ratios=(1.3, 1, 1))
    _draw_spatial(figure.add_subplot(grid[:, 0], projection="3d"), case, found)
    across = figure.add_subplot(grid[0, 1])
    panel(across, "A2", "plane strain: the section")
    _draw_section(across, case)
    along = figure.add_subplot(grid[1, 1])
    panel(along, "B", f"pressure on the skin at {case.depth:g} mm")
    _draw_pressure(along, found.reference.skin)
    curves = figure.add_subplot(grid[:, 2])
    panel(curves, "C", "P(d) = 1 - (RF3D / L) / RF2D")
    _draw_curves(curves, case, found, lengths)
    return save(figure, out, "figure-4", svg=True)


def _draw_spatial(axes: Any, case: CorrectionCase, found: Calibrated) -> None:
    """Draw the upper half of the deformed skin, coloured by pressure, and the cylinder."""
    quarter = found.reference.skin
    quarter = quarter[quarter[:, 1] > 0]
    mirrored = [quarter * (x, 1, z, x, 1, z, 1) for x in (1, -1) for z in (1, -1)]
    skin = np.concatenate(mirrored)
    deformed, pressure = skin[:, 3:6], skin[:, 6]
    triangles = Triangulation(_around(skin), skin[:, 2]).triangles
    shown = axes.plot_trisurf(
        deformed[:, 0],
        deformed[:, 2],
        deformed[:, 1],
        triangles=triangles,
        cmap="viridis",
        shade=False,
        edgecolor="none",
    )
    shown.set_array(pressure[triangles].mean(axis=1))
    shown.set_clim(0, pressure.max())
    shown.set_rasterized(True)
    cylinder, leg = case.cylinder, case.leg
    angle, along = np.meshgrid(np.linspace(0, 2 * np.pi, 40), [-0.5, 0.5])
    centre = leg.radius + cylinder.radius - case.depth
    axes.plot_surface(
        cylinder.radius * np.sin(angle),
        along * cylinder.length,
        centre + cylinder.radius * np.cos(angle),
        color=FAINT,
        alpha=0.35,
    )
    axes.set_box_aspect([np.ptp(limits()) for limits in (axes.get_xlim, axes.get_ylim, axes.get_zlim)], zoom=0.8)
    axes.view_init(elev=30, azim=-50)
    axes.set(xlabel="x (mm)", zlabel="y (mm)")
    axes.set_ylabel("along the leg (mm)", labelpad=8)
    panel(axes, "A1", f"3D: the skin at {case.depth:g} mm")
    axes.computed_zorder = False  # the cylinder in front
    axes.figure.colorbar(shown, ax=axes, shrink=0.5, label="pressure (kPa)", location="bottom")


def _around(skin: FloatArray) -> FloatArray:
    """Return the length along the undeformed skin from under the cylinder (mm)."""
    return np.arctan2(skin[:, 0], skin[:, 1]) * np.hypot(skin[:, 0], skin[:, 1]).mean()


def _draw_section(axes: Any, case: CorrectionCase) -> None:
    leg, cylinder = case.leg, case.cylinder
    turn = np.linspace(0, 2 * np.pi, 200)
    for region, radius in reversed(leg.layers):
        axes.fill(radius * np.sin(turn), radius * np.cos(turn), color=REGION_COLOURS[region])
    axes.fill(
        leg.bone_radius * np.sin(turn), leg.bone_offset + leg.bone_radius * np.cos(turn), color="white", ec="black"
    )
    axes.fill(cylinder.radius * np.sin(turn), leg.radius + cylinder.radius * (1 + np.cos(turn)), color=FAINT)
    axes.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)")


def _draw_pressure(axes: Any, skin: FloatArray) -> None:
    """Draw the pressure on the lines of quadrature points next to the two mirror planes."""
    around = _around(skin)
    for name, place, beside, colour in (
        ("along the cylinder", skin[:, 2], around, COLOURS[0]),
        ("across it", around, skin[:, 2], COLOURS[1]),
    ):
        line = np.flatnonzero(np.isclose(beside, beside.min(), atol=0.05))
        line = line[np.argsort(place[line])]
        line = line[place[line] < 60]
        axes.plot(place[line], skin[line, 6], ".-", color=colour, ms=3, lw=1, label=name)
    axes.set(xlabel="distance on the undeformed skin from the middle (mm)", ylabel="kPa")
    axes.legend()


def _draw_curves(axes: Any, case: CorrectionCase, found: Calibrated, lengths: dict[str, FloatArray]) -> None:
    correction = found.correction
    displacement = correction.displacement
    material = case.material
    P = correction.correction(displacement, *material.stiffness)
    spread = 1.96 * correction.standard_deviation(displacement)
    label = f"the correction ({case.cylinder.length:g} mm, 95 %)"
    axes.fill_between(displacement, P - spread, P + spread, color="#DDDDDD", label=label)
    axes.plot(displacement, P, color="#111111", lw=2)
    for (length, curve), colour in zip(lengths.items(), COLOURS, strict=False):
        axes.plot(displacement, curve, "--", color=colour, label=f"cylinder of {length} mm, coarser mesh")
    axes.axhline(0, color=FAINT, lw=0.8)
    axes.set(xlabel="displacement of the cylinder (mm)", ylabel="P")
    axes.legend(fontsize=8)

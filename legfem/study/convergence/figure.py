"""The convergence study as a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from legfem.report.style import FAINT, new_figure, panel, save, styled
from legfem.study.convergence.meshes import Convergence

COLOURS = ("#E69F00", "#56B4E9", "#009E73")


@styled
def draw_convergence(found: Convergence, path: Path) -> None:
    """Draw the default curve and every mesh's distance from the extrapolated force."""
    figure = new_figure(10, 4)
    left, right = figure.subplots(1, 2)
    fine = np.linspace(0, found.default.depth, 300)
    panel(left, "A", "force of the default settings")
    left.plot(fine, found.default(fine), color="#0072B2", label="F(d)")
    left.plot(found.default.displacement, found.default.force, "o", ms=3, color="#0072B2", label="solved steps")
    left.plot(found.depths, found.richardson.extrapolated, "x", color="#111111", label="extrapolated to zero size")
    left.set_xlabel("displacement of the indenter (mm)")
    left.set_ylabel("force (N)")
    left.legend()

    panel(right, "B", "distance from the extrapolated force")
    right.axhspan(-0.5, 0.5, color="#EEEEEE", label="±0.5 %")
    right.axhline(0, color=FAINT, lw=0.8)
    limit = found.richardson.extrapolated
    for curve, report, colour in zip(found.meshes, found.mesh_reports, COLOURS, strict=True):
        error = 100 * (curve(found.depths) / limit - 1)
        label = f"{report.unknowns} unknowns, small steps"
        right.plot(found.depths, error, "o-", color=colour, label=label)
    right.plot(found.depths, 100 * found.default_error, "s--", color="#0072B2", label="default")
    right.plot(found.depths, 100 * found.contact_change, ":", color="#CC79A7", label="change with contact x4")
    right.set_xlabel("displacement of the indenter (mm)")
    right.set_ylabel("%")
    right.legend(fontsize=8)
    save(figure, path.parent, path.stem)

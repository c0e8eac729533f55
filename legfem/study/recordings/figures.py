"""Recordings against the model before and after its repair."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from legfem.report.style import DATA_COLOUR, FAINT, new_figure, panel, save, styled
from legfem.study.recordings.compression import Compressed
from legfem.study.recordings.indentation import HELD_OUT_S, Indented

BEFORE, AFTER, SAME = "#D55E00", "#0072B2", "#E69F00"


@styled
def draw_indented(found: Indented, path: Path) -> list[Path]:
    """Draw force against time, and the residuals, of one indentation."""
    figure = new_figure(10, 4)
    left, right = figure.subplots(1, 2)
    seen, mended = found.observed, found.repair
    time, force = found.samples
    end = float(seen.time.max())
    kinds = found.test.material.replace("_", " ")
    figure.suptitle(
        f"{found.test.name}, {kinds}: measured data, named {', '.join(mended.names) or 'nothing'}",
        x=0.01, ha="left", fontsize=11,
    )  # fmt: skip
    panel(left, "A", "force")
    late = time > float(seen.protocols[0].protocol.time[-2])
    left.plot(time[late], force[late], ".", ms=3, color=DATA_COLOUR, label="recording")
    left.plot(seen.time, seen.force, "o", ms=3, mfc="none", color=DATA_COLOUR,
              label="at the stations")  # fmt: skip
    for fitted, colour, label in (
        (found.ramp, BEFORE, "elastic, fitted to the ramp"),
        (mended.base, SAME, "elastic, fitted to all but the held-out part"),
        (mended.best, AFTER, "repaired, fitted to the same"),
    ):
        left.plot(seen.time, fitted.prediction, color=colour, label=label)
        right.plot(seen.time, seen.force - fitted.prediction, color=colour)
    for drop in found.drops:
        for axes in (left, right):
            at = np.interp(drop.end_mm - found.air, seen.displacement, seen.time)
            axes.axvline(at, color="#CC79A7", lw=1, ls="--")
        left.annotate("force drop", (at, float(force.max())), color="#CC79A7", fontsize=8)
    if found.air:
        left.axvspan(float(time[0]), 0.0, color="#E8F3FA", label=f"{found.air:.2f} mm of air")
    for axes in (left, right):
        axes.axvspan(end - HELD_OUT_S, end, color="#EEEEEE")
        axes.set_xlabel("time since first contact (s)")
    left.set_ylabel("force (N)")
    left.legend(fontsize=8)
    panel(right, "B", "recording less model; grey: held out")
    right.axhline(0, color=FAINT, lw=0.8)
    right.set_ylabel("N")
    return save(figure, path.parent, path.stem)


@styled
def draw_compressed(found: Compressed, path: Path) -> list[Path]:
    """Draw force against compression, and the residuals, of one phantom."""
    figure = new_figure(10, 4)
    left, right = figure.subplots(1, 2)
    seen = found.observed
    figure.suptitle(
        f"{found.phantom.recording.trial}: measured data, neo-Hookean with two kinds of ends",
        x=0.01, ha="left", fontsize=11,
    )  # fmt: skip
    left.plot(seen.displacement, seen.force, ".", color=DATA_COLOUR, label="recording")
    for one, colour in zip(found.fits, (BEFORE, AFTER), strict=True):
        base = one.repair.base
        label = f"{one.ends} ends, C10 = {base.values['C10']:.2f} kPa"
        left.plot(seen.displacement, base.prediction, color=colour, label=label)
        right.plot(seen.displacement, base.residual, color=colour)
    panel(left, "A", "force")
    left.set_ylabel("force (N)")
    left.legend(fontsize=8)
    panel(right, "B", "recording less model; grey: held out")
    right.axhline(0, color=FAINT, lw=0.8)
    right.set_ylabel("N")
    fitted = found.fits[0].repair.base
    beyond = seen.displacement[len(fitted.whitened)] if len(fitted.whitened) < len(
        seen.displacement) else seen.displacement[-1]  # fmt: skip
    for axes in (left, right):
        axes.axvspan(beyond, float(seen.displacement[-1]), color="#EEEEEE")
        axes.set_xlabel("compression (mm)")
    return save(figure, path.parent, path.stem)

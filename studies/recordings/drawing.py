"""Pictures of indentations and compressions, and one indentation studied and drawn by a worker."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from legfem.jobs.store import Store
from legfem.report.style import DATA_COLOUR, FAINT, new_figure, panel, save, styled
from studies.recordings.curves import FITTED_STRAIN, CompressedPhantom, LayerCurves
from studies.recordings.data import MeatTest
from studies.recordings.indentation import HELD_OUT_S, Indented, Row, try_indentation

BEFORE, AFTER, SAME = "#D55E00", "#0072B2", "#E69F00"


@styled
def draw_indented(found: Indented, path: Path) -> list[Path]:
    """Draw force against time, and the residuals, of one indentation."""
    figure = new_figure(10, 4)
    left, right = figure.subplots(1, 2)
    seen = found.whole
    at = found.motion.at_stations(seen)
    time, force = found.samples
    end = float(found.motion.time[-1])
    kinds = found.test.material.replace("_", " ")
    named = ", ".join(found.best.names) or "nothing"
    figure.suptitle(f"{found.test.name}, {kinds}: measured data, named {named}", x=0.01, ha="left", fontsize=11)
    panel(left, "A", "force")
    left.plot(time, force, ".", ms=3, color=DATA_COLOUR, label="recording")
    for prediction, colour, label in (
        (found.before, BEFORE, "elastic"),
        (found.alone, SAME, "explained"),
        (found.after, AFTER, "explained, with the errors seen"),
    ):
        left.plot(at, prediction, color=colour, label=label)
        right.plot(at, seen.force - prediction, color=colour)
    for drop in found.drops:
        when = np.interp(drop.end_mm - seen.contacts[0].displacement, seen.displacement, at)
        for axes in (left, right):
            axes.axvline(when, color="#CC79A7", lw=1, ls="--")
        left.annotate("force drop", (when, float(force.max())), color="#CC79A7", fontsize=8)
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
def draw_compressed(found: CompressedPhantom, path: Path) -> list[Path]:
    """Draw force against compression, and the residuals, of one phantom."""
    figure = new_figure(10, 4)
    left, right = figure.subplots(1, 2)
    figure.suptitle(
        f"{found.phantom.recording.trial}: measured data, neo-Hookean with two kinds of ends",
        x=0.01,
        ha="left",
        fontsize=11,
    )
    left.plot(found.displacement, found.force, ".", color=DATA_COLOUR, label="recording")
    for one, colour in zip(found.fits, (BEFORE, AFTER), strict=True):
        label = f"{one.ends} ends, C10 = {one.c10:.2f} kPa"
        left.plot(found.displacement, one.prediction, color=colour, label=label)
        right.plot(found.displacement, found.force - one.prediction, color=colour)
    panel(left, "A", "force")
    left.set_ylabel("force (N)")
    left.legend(fontsize=8)
    panel(right, "B", "recording less model; grey: held out")
    right.axhline(0, color=FAINT, lw=0.8)
    right.set_ylabel("N")
    for axes in (left, right):
        axes.axvspan(FITTED_STRAIN * found.phantom.height, float(found.displacement[-1]), color="#EEEEEE")
        axes.set_xlabel("compression (mm)")
    return save(figure, path.parent, path.stem)


DRAWN = ("230331|RDG1 1A", "230331|RDG1 1B", "230403|230403-FF1A", "230515|230515-P002-9")


def studied(test: MeatTest, layers: LayerCurves, store: Store[Row], out: Path) -> Row:
    """Study one indentation unless it is kept, and draw some of them."""

    def draw(found: Indented) -> None:
        if test.name in DRAWN:
            draw_indented(found, out / test.name.replace(" ", "-").replace("|", "-"))

    return store.get_or_make(test.name, lambda: try_indentation(test, layers, draw))

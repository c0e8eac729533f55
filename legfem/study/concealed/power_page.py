"""Counted detection power, as a table and a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from legfem.diagnose.diagnosis import mechanism_named
from legfem.report.diagnosis_style import plain
from legfem.report.style import FAINT, new_figure, styled
from legfem.study.concealed.power import POWER, RATIOS, PowerCurve

PROTOCOL_NAMES = {"ramps": "loading alone", "rates": "two rates with holds"}
_COLOURS = {"ramps": "#D55E00", "rates": "#0072B2"}
_COLUMNS = 4


def power_document(curves: Sequence[PowerCurve]) -> dict[str, Any]:
    """Return the curves as JSON types."""
    return {"schema": 1, "origin": "emulated", "power": [curve.document() for curve in curves]}


def power_page(curves: Sequence[PowerCurve]) -> str:
    """Return the table in Markdown."""
    ratios = ", ".join(f"{ratio:g}" for ratio in RATIOS)
    lines = [
        f"| mechanism (parameter) | recordings | found at {ratios} times the linear estimate | "
        "80 % power at (times) | strength found at 80 % power |",
        "|---|---|---|---|---|",
    ]
    for curve in curves:
        first = mechanism_named(curve.mechanism).parameters[0]
        counted = ", ".join("{}/{}".format(*curve.counted(ratio)) for ratio in RATIOS)
        ratio, strengths = curve.ratio_found, curve.smallest
        unit = "" if first.unit == "-" else f" {first.unit}"
        lines.append(
            f"| {curve.mechanism} ({first.name}) | {PROTOCOL_NAMES[curve.protocol]} | {counted} | "
            + ("not within these" if ratio is None else f"{ratio:.2f}")
            + " | "
            + ("-" if strengths is None else f"{strengths[0]:.2g} to {strengths[1]:.2g}{unit}")
            + " |"
        )
    return "\n".join(lines) + "\n"


@styled
def power_figure(curves: Sequence[PowerCurve]) -> Figure:
    """Draw the share that was found against the effect's strength, a panel a mechanism.

    Mechanisms that can't be strong enough to be found have none.
    """
    names = list(dict.fromkeys(curve.mechanism for curve in curves if len(curve.ratios)))
    rows = -(-len(names) // _COLUMNS)
    figure = new_figure(11, 2.2 * rows + 0.8)
    panels = figure.subplots(rows, _COLUMNS, sharex=True, sharey=True, squeeze=False)
    fine = np.geomspace(0.8 * RATIOS[0], 1.2 * RATIOS[-1], 200)
    for axes in panels.flat[len(names) :]:
        axes.set_visible(False)
    for number, name in enumerate(names):
        axes = panels.flat[number]
        axes.set_title(plain(name), fontsize=9)
        axes.tick_params(labelbottom=number + _COLUMNS >= len(names))
        axes.axhline(POWER, color=FAINT, lw=0.8, ls=":")
        axes.axvline(1.0, color=FAINT, lw=0.8, ls=":")
        for curve in (c for c in curves if c.mechanism == name):
            if not len(curve.ratios):
                continue
            counted = [(ratio, *curve.counted(ratio)) for ratio in RATIOS]
            shares = np.array([(ratio, hit / of) for ratio, hit, of in counted if of])
            colour = _COLOURS[curve.protocol]
            axes.plot(*shares.T, "o", ms=4, color=colour)
            axes.plot(fine, curve.power(fine), color=colour, label=PROTOCOL_NAMES[curve.protocol])
        axes.set_xscale("log")
        axes.set_xticks(RATIOS, [f"{ratio:g}" for ratio in RATIOS])
        axes.minorticks_off()
        axes.set_ylim(-0.05, 1.05)
    drawn = {
        label: handle
        for axes in panels.flat[: len(names)]
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(drawn.values(), drawn.keys(), loc="outside upper right", ncols=2)
    figure.supxlabel("strength over the linear estimate of what is found at 80 % power")
    figure.supylabel("share in which a mismatch was called")
    figure.suptitle(
        "Detection power, counted on emulated recordings (lines: fitted probit)",
        x=0.01, ha="left", fontsize=12,
    )  # fmt: skip
    return figure

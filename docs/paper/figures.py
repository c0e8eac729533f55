"""The paper's figures, from what build.py took from the pages and from files of the repository."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle

import legfem as lf
from legfem.geometry.indenter import first_touch
from legfem.report.style import DATA_COLOUR, FAINT, TOOL_COLOUR, new_figure, panel, part_colour, styled
from legfem.report.style import LAW_COLOURS as COLOURS
from studies.cases.sealed_picture import COUNTED, draw, read_counted

FONTS = str(Path(matplotlib.get_data_path()) / "fonts" / "ttf")
SMALL = {"font.size": 8, "axes.titlesize": 8.5, "svg.fonttype": "none"}
SUBJECT = "3"
MARKS = dict(zip("osD^v<>", (*COLOURS.values(), DATA_COLOUR, FAINT, "#56B4E9"), strict=True))


@styled
def draw_all(folder: Path, found: dict[str, Any]) -> None:
    """Write every figure into a folder, as SVG."""
    draw(folder / "sealed.svg", read_counted(COUNTED))
    with matplotlib.rc_context(SMALL):
        for name, make in (("problem", problem), ("peers", peers), ("ends", ends), ("people", people)):
            make(found).savefig(folder / f"{name}.svg", metadata={"Date": None})


def problem(_: dict[str, Any]) -> Figure:
    """Draw a leg's section with the cylinder beside its recordings."""
    leg = lf.load_subject(SUBJECT)
    section, pressed = leg.section, leg.indenter
    figure = new_figure(3.5, 2.0)
    left, right = figure.subplots(1, 2)
    for part in section.parts:
        left.fill(*section.contour(part).T, facecolor=part_colour(section, part), edgecolor=DATA_COLOUR, lw=0.6)
    centre = first_touch(section.skin, pressed.radius, pressed.aim, pressed.direction)
    left.add_patch(Circle(centre, pressed.radius, facecolor=TOOL_COLOUR, edgecolor=DATA_COLOUR, lw=0.6))
    left.annotate("", centre + 30 * pressed.direction, centre, arrowprops={"arrowstyle": "->", "lw": 1.2})
    left.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)")
    for trial, colour in zip(leg.recordings, COLOURS.values(), strict=False):
        right.plot(trial.displacement, trial.force, color=colour, lw=0.8)
    right.set(xlabel="displacement (mm)", ylabel="force (N)")
    panel(left, "a", "section")
    panel(right, "b", f"{len(leg.recordings)} trials")
    return figure


def peers(found: dict[str, Any]) -> Figure:
    """Draw C10's error and interval of each way, case by case."""
    rows = found["tables"]["peer_cases"]["rows"]
    ways, cases = list(dict.fromkeys(row[3] for row in rows)), list(dict.fromkeys(row[0] for row in rows))
    figure = new_figure(3.5, 4.2)
    axes = figure.subplots()
    for k, (way, (mark, colour)) in enumerate(zip(ways, MARKS.items(), strict=True)):
        own = [row for row in rows if row[3] == way]
        off, half = (np.array([float(row[column]) for row in own]) for column in (6, 7))
        at = [cases.index(row[0]) + 0.11 * (k - 3) for row in own]
        axes.errorbar(off, at, xerr=half, fmt=mark, ms=3.5, color=colour, lw=1, capsize=1.5, label=way)
    truths = {row[0]: f"{row[0]}: {row[1].replace('-', ' ')}" for row in rows}
    axes.axvline(0, color=FAINT, lw=0.8, zorder=0)
    axes.set(yticks=range(len(cases)), yticklabels=truths.values(), xlabel="C10 off, with its 95 % interval (%)")
    axes.invert_yaxis()
    figure.legend(loc="outside lower center", ncols=2, handletextpad=0.3)
    return figure


def ends(found: dict[str, Any]) -> Figure:
    """Draw P(d) of one leg by its own solution in 3D and by the table of idealised legs."""
    header, rows = (found["tables"]["real_leg"][part] for part in ("header", "rows"))
    figure = new_figure(3.5, 1.9)
    axes = figure.subplots()
    ways = (("P", "sd", "the leg's own solution", -0.15), ("table's P", "table's sd", "table of idealised legs", 0.15))
    for (value, error, label, beside), (mark, colour) in zip(ways, MARKS.items(), strict=False):
        d, P, sd = (np.array([float(row[header.index(one)]) for row in rows]) for one in ("d (mm)", value, error))
        axes.errorbar(d + beside, P, yerr=sd, fmt=mark, ms=4, color=colour, lw=1, capsize=2, label=label)
    axes.set(xlabel="displacement (mm)", ylabel="P", xticks=d)
    figure.legend(loc="outside lower center", ncols=2, handletextpad=0.3)
    return figure


def people(found: dict[str, Any]) -> Figure:
    """Draw the errors of predicting people who were left out, site by site."""
    header, rows = (found["tables"]["people"][part] for part in ("header", "rows"))
    figure = new_figure(3.5, 2.4)
    axes = figure.subplots()
    shown = ("mechanics", "two springs", "two springs, least relative error", "one number, no thickness")
    for name, (mark, colour) in zip(shown, list(MARKS.items())[: len(shown)], strict=True):
        errors = [float(row[header.index(name)]) for row in rows]
        axes.plot(errors, range(len(rows)), mark, ms=4, color=colour, label=name)
    axes.set(yticks=range(len(rows)), yticklabels=[row[0] for row in rows], xlabel="mean relative error (%)")
    axes.invert_yaxis()
    figure.legend(loc="outside lower center", ncols=2, handletextpad=0.3)
    return figure

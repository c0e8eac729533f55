"""``python -m legfem.geometry``: a subject folder from cross-sections."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from legfem.common.checks import check_finite
from legfem.common.command_edge import command_edge
from legfem.common.doubts import say
from legfem.geometry.section import fat_thickness, girth
from legfem.subjects.from_cross_sections import convert_cross_sections
from legfem.subjects.plausibility import doubts_about
from legfem.subjects.subject import load_subject

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command()
def convert(
    cross_sections: Annotated[
        Path, typer.Option(help="CSV file: level_mm,part,loop,i,x_mm,y_mm.", show_default=False)
    ],
    level: Annotated[float, typer.Option(help="Level of the section, mm.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Subject folder to make.", show_default=False)],
    fascia_thickness: Annotated[float, typer.Option(help="mm.")] = 0.6,
    aim: Annotated[
        tuple[float, float] | None,
        typer.Option(help="Point on the line of travel, mm; the rearmost one by default."),
    ] = None,
    direction: Annotated[
        float, typer.Option(help="Direction of travel, degrees from +x; 270 is along -y.")
    ] = 270.0,
) -> None:
    """Make a subject folder (contours and subject.toml) from cross-sections of leg surfaces.

    Parts: skin, muscle_hull, tibia, fibula. +y is posterior unless you give --aim and
    --direction.

    Example: python -m legfem.geometry --cross-sections cross_sections_5mm.csv --level 300
    --out my-leg
    """
    with command_edge("run the same command again"):
        check_finite(level=level, fascia_thickness=fascia_thickness, direction=direction)
        point = None if aim is None else np.array(aim)
        if point is not None:
            check_finite(aim=float(point.sum()))
        convert_cross_sections(cross_sections, level, out, fascia_thickness, point, direction)
        subject = load_subject(out, need_recordings=False)
        say(doubts_about(subject))
    section, indenter = subject.section, subject.indenter
    fat = fat_thickness(section, indenter.aim, indenter.direction)
    print(
        f"{out}: girth {girth(section):.0f} mm, fat under the indenter {fat:.1f} mm. "
        f"Next: put the trials into {out / 'recordings'} and your instruments' figures into "
        f"{out / 'subject.toml'}."
    )

"""``python -m studies.cohort.two_layers``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from legfem.channels.kinds import CHANNELS
from legfem.common.command_line import study_context
from legfem.common.documents import write_atomically
from legfem.data import Recording, write_recording
from legfem.data.recording import RecordedChannel
from studies.command_line import DONE_IS_KEPT, Out, new_app
from studies.people.__main__ import CALF
from studies.people.data import Indentations, read_indentations

app = new_app()
_AROUND = 10.0
"""Of the layers' diameter over the probe's, as in `studies.people.probe`."""
_FRAMES = 25
_SECONDS = 5.0
"""Of a press: the table's rates have no unit."""
_FORCE_SHARE, _LOSS_SD_MM = 0.02, 0.2
_FOLDER = """\
id = "{name}"
title = "Calf of {name}, skin and fat over muscle, by a flat ultrasound probe"
origin = "measured"
confirmed = ["punch.punch_diameter_mm"]

[punch]
punch_diameter_mm = {diameter:.3f}
diameter_mm = {around:.3f}

[[layers]]
name = "superficial"
thickness_mm = {superficial:.3f}

[[layers]]
name = "deep"
thickness_mm = {deep:.3f}

[tissue]
poisson_ratio = 0.49

[instrument]
force_sd_N = {force_sd:.4f}
displacement_sd_mm = {loss_sd}

[recordings]
starts_at_contact = true
"""


def write_person(folder: Path, rows: Indentations, k: int) -> None:
    """Write a person's press as a specimen of two layers: a straight line, which is all that the table has."""
    share = np.linspace(0.0, 1.0, _FRAMES)
    force, diameter = float(rows.force[k]), 2 * float(rows.radius[k])
    text = _FOLDER.format(
        name=folder.name,
        diameter=diameter,
        around=_AROUND * diameter / 2,
        superficial=rows.superficial[k],
        deep=rows.deep[k],
        force_sd=_FORCE_SHARE * force,
        loss_sd=_LOSS_SD_MM,
    )
    (folder / "recordings").mkdir(parents=True, exist_ok=True)
    write_atomically(folder / "specimen.toml", text)
    lost = float(rows.superficial_loss[k] + rows.deep_loss[k])
    frame = {"fat_thickness": rows.superficial - rows.superficial_loss, "muscle_thickness": rows.deep - rows.deep_loss}
    seen = tuple(
        RecordedChannel(name, np.array([_SECONDS]), left[[k]], CHANNELS[name].usual) for name, left in frame.items()
    )
    recording = Recording(_SECONDS * share, lost * share, force * share, "press", channels=seen)
    write_recording(recording, folder / "recordings" / "press.csv")


@app.command()
def two_layers(
    data: Annotated[Path, typer.Option(help="Folder of the MULTIS table (doi 10.18735/S5R97F).")],
    people: Annotated[int | None, typer.Option(min=1, help="How many; all by default.")] = None,
    out: Out = None,
) -> None:
    """Write the calves of living people as a cohort's folder, for legfem cohort.

    Example: python -m studies.cohort.two_layers --data ../shared/data/multis_in_vivo --out results/multis
    """
    rows = read_indentations(data)
    calves = rows.where(rows.site == rows.sites.index(CALF))
    with study_context("cohort-two-layers", out, 1, DONE_IS_KEPT) as (folder, _):
        table = []
        for k in range(len(calves))[:people]:
            name = calves.people[calves.person[k]]
            write_person(folder / name, calves, k)
            sizes = {"superficial_mm": round(calves.superficial[k], 2), "deep_mm": round(calves.deep[k], 2)}
            table.append({"subject": name, "folder": name, **sizes})
        write_atomically(folder / "cohort.csv", pd.DataFrame(table).to_csv(index=False))
        print(f"{len(table)} people in {folder}")


if __name__ == "__main__":
    app(prog_name="python -m studies.cohort.two_layers")

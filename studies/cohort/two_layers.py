"""``python -m studies.cohort.two_layers``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import tomlkit
import typer

from legfem.channels.kinds import CHANNELS
from legfem.common.command_line import study_context
from legfem.common.documents import write_atomically
from legfem.data import Recording, write_recording
from legfem.data.recording import RecordedChannel
from studies.command_line import DONE_IS_KEPT, Out, new_app
from studies.people.__main__ import CALF, TISSUES
from studies.people.data import Indentations, read_indentations

app = new_app()
_AROUND = 10.0
"""Of the layers' diameter over the probe's, as in `studies.people.probe`."""
_FRAMES = 25
_SECONDS = 5.0
"""Of a press: the table's rates have no unit."""
_FORCE_SHARE, _LOSS_SD_MM = 0.02, 0.2


def write_person(folder: Path, rows: Indentations, k: int) -> None:
    """Write a person's press as a specimen of two layers: a straight line, which is all that the table has."""
    share = np.linspace(0.0, 1.0, _FRAMES)
    force, diameter = float(rows.force[k]), 2 * float(rows.radius[k])
    document = {
        "id": folder.name,
        "title": f"Calf of {folder.name}, skin and fat over muscle, by a flat ultrasound probe",
        "origin": "measured",
        "confirmed": ["punch.punch_diameter_mm"],
        "punch": {"punch_diameter_mm": round(diameter, 3), "diameter_mm": round(_AROUND * diameter / 2, 3)},
        "layers": [{"name": name, "thickness_mm": round(float(getattr(rows, name)[k]), 3)} for name in TISSUES],
        "tissue": {"poisson_ratio": 0.49},
        "instrument": {"force_sd_N": round(_FORCE_SHARE * force, 4), "displacement_sd_mm": _LOSS_SD_MM},
        "recordings": {"starts_at_contact": True},
    }
    (folder / "recordings").mkdir(parents=True, exist_ok=True)
    write_atomically(folder / "specimen.toml", tomlkit.dumps(document))
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

"""``python -m studies.recordings``."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from legfem.common.command_line import study_context
from legfem.common.documents import Contents
from legfem.common.errors import InputError
from legfem.common.progress import progress_on
from legfem.inverse.catalogue import LawName
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, finish
from legfem.specimens.laws import laws_named
from studies.command_line import DONE_IS_KEPT, Jobs, Out, new_app, write_results
from studies.recordings.fitting import Fitted, fitted, page
from studies.recordings.folders import Assumed, write_specimen_folders

app = new_app()


def run(paths: list[Path], law: LawName, out: Path, jobs: int) -> None:
    """Fit folders, each in one process, and write what was found; a rerun goes on."""
    store = Store(out / "fits", Fitted, law, ("studies.recordings.fitting",))
    with progress_on() as progress, Workers(fitted, law, jobs) as workers:
        found = finish(
            workers,
            paths,
            store,
            progress,
            "fitting public recordings",
            lambda path, one: f"{path.name}: {one.used} of {one.recordings}",
            asked=Contents,
        )
    document = {"origin": "measured", "unit": "kPa", "folders": [asdict(one) for one in found]}
    write_results(out, document, page(found))


@app.command()
def recordings(
    data: Annotated[Path, typer.Option(help="Folder with the two public sets of recordings.")],
    folder: Annotated[list[str] | None, typer.Option(help="Material or kind of phantom; all by default.")] = None,
    law: Annotated[str, typer.Option(help="Fitted to each folder.")] = "reduced-polynomial",
    ball_radius: Annotated[float, typer.Option(min=0.1, help="Of the indenter, not stated (mm).")] = 5.0,
    layer_radius: Annotated[float, typer.Option(min=1.0, help="Of the specimens (mm).")] = 40.0,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Write public recordings of beef and silicone as folders of specimens, and fit each folder by one law.

    Example: python -m studies.recordings --data ../shared/data
    """
    with study_context("recordings", out, jobs, DONE_IS_KEPT) as (results, processes):
        (chosen,) = laws_named(law)
        made = write_specimen_folders(data, results / "specimens", Assumed(ball_radius, layer_radius))
        names = [path.name for path in made]
        if unknown := set(folder or ()) - set(names):
            raise InputError("--folder", sorted(unknown)[0], "is none of them", f"choose from {', '.join(names)}")
        run([path for path in made if not folder or path.name in folder], chosen, results, processes)


if __name__ == "__main__":
    app(prog_name="python -m studies.recordings")

"""``python -m studies.recordings``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from legfem.commands.study import Jobs, Out
from legfem.common.command_line import end_without_a_solution, study_context

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command()
def recordings(
    data: Annotated[Path, typer.Option(help="Folder with the two public sets of recordings.")],
    test: Annotated[list[str] | None, typer.Option(help="Indentation by its name; all by default.")] = None,
    ball_radius: Annotated[
        float, typer.Option(min=0.1, help="Of the indenter, which the data don't state (mm).")
    ] = 5.0,
    layer_radius: Annotated[float, typer.Option(min=1.0, help="Of the specimens (mm).")] = 40.0,
    specimen_folders: Annotated[
        Path | None, typer.Option(help="Only write the data as folders for legfem.identify --specimen-dir.")
    ] = None,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Diagnose public recordings of beef and silicone: what the elastic model leaves out.

    Example: python -m studies.recordings --data ../shared/data
    """
    with study_context("recordings", out, jobs) as (folder, processes):
        from studies.recordings import command
        from studies.recordings.indentation import Assumed

        assumed = Assumed(ball_radius, layer_radius)
        if specimen_folders is not None:
            from studies.recordings.folders import write_specimen_folders

            for made in write_specimen_folders(data, specimen_folders, assumed):
                print(made)
            return
        if not command.run(data, test or [], assumed, folder, processes):
            end_without_a_solution("recordings")


if __name__ == "__main__":
    app(prog_name="python -m studies.recordings")

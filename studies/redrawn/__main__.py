"""``python -m studies.redrawn``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from legfem.commands.study import Jobs, Library, Out
from legfem.common.command_line import study_context
from legfem.common.progress import progress_on

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command()
def redrawn(
    foreign: Annotated[Path, typer.Option(help="Folder of another code's cases, with truth.json.")],
    n: Annotated[int, typer.Option("--n", min=1, help="Sets of recordings of each case.")] = 6,
    only: Annotated[list[str] | None, typer.Option(help="Cases; all without it. May be given again.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of all draws.")] = 1,
    library: Library = None,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Diagnose another code's legs with effects, recorded anew with errors as labs have them.

    A case is a subject folder with clean.csv, the code's own course of each trial. Every diagnosis
    is kept as it is done: the same command goes on where it was stopped.

    Example: python -m studies.redrawn --foreign ../shared/foreign --n 6
    """
    resume = "run the same command again to go on; what is done is kept"
    with study_context("redrawn", out, jobs, resume) as (folder, processes):
        from legfem.legs.variants import library_folder
        from studies.redrawn import command

        with progress_on() as progress:
            lines = command.run(foreign, n, only or (), seed, library or library_folder(), folder, processes, progress)
        for line in lines:
            typer.echo(line)


if __name__ == "__main__":
    app(prog_name="python -m studies.redrawn")

"""``python -m studies.nulls``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from legfem.commands.study import Jobs, Library, Out
from legfem.common.command_line import study_context
from legfem.common.progress import progress_on

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command()
def nulls(
    n: Annotated[int, typer.Option("--n", min=1, help="Sets of recordings.")] = 300,
    legs: Annotated[int, typer.Option(min=1, help="Misstated legs of a level of outline error.")] = 4,
    crosscheck: Annotated[Path, typer.Option(help="Folder of the cross-check's two clean curves.")] = Path(
        "tests/data/crosscheck"
    ),
    foreign: Annotated[Path | None, typer.Option(help="Folder that has case-30 and case-06 with clean curves.")] = None,
    only: Annotated[
        list[str] | None, typer.Option(help="Errors to begin with (as the report names them); all without it.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of all draws.")] = 1,
    library: Library = None,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Count false alarms on recordings without any left-out physics, with errors as labs have them.

    The true curves are another code's. Every diagnosis is kept as it is done: the same command goes
    on where it was stopped.

    Example: python -m studies.nulls --n 300 --foreign ../shared/foreign
    """
    resume = "run the same command again to go on; what is done is kept"
    with study_context("nulls", out, jobs, resume) as (folder, processes):
        from legfem.legs.variants import library_folder
        from studies.nulls import command

        with progress_on() as progress:
            lines = command.run(
                n, legs, only or (), seed, crosscheck, foreign, library or library_folder(), folder, processes, progress
            )
        for line in lines:
            typer.echo(line)


if __name__ == "__main__":
    app(prog_name="python -m studies.nulls")

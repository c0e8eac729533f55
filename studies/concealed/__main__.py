"""``python -m studies.concealed``."""

from __future__ import annotations

from typing import Annotated

import typer

from legfem.commands.study import Jobs, Library, Out
from legfem.common.command_line import study_context
from legfem.common.progress import progress_on

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command()
def concealed(
    make: Annotated[int | None, typer.Option(min=1, help="Make so many sealed cases (simulated).")] = None,
    run: Annotated[bool, typer.Option("--run", help="Diagnose the cases, blind.")] = False,
    score: Annotated[bool, typer.Option("--score", help="Open the keys and score.")] = False,
    legs: Annotated[int, typer.Option(min=1, help="True legs, each stated wrongly in its own way.")] = 6,
    people: Annotated[int, typer.Option(min=1, help="Stiffnesses of the muscle behind each leg.")] = 3,
    seed: Annotated[int, typer.Option(min=0, help="Of the cases; opens the keys.")] = 1,
    library: Library = None,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Prove the diagnosis on sealed cases: make them, diagnose them blind, open the keys.

    Cases, diagnoses and solutions are kept as they are done: the same command goes on where it was
    stopped.

    Example: python -m studies.concealed --make 150 --run --score --seed 1
    """
    resume = "run the same command again to go on; what is done is kept"
    with study_context("concealed", out, jobs, resume) as (folder, processes):
        from legfem.common.errors import InputError
        from legfem.legs.variants import library_folder
        from studies.concealed import command

        if make is None and not run and not score:
            raise InputError("concealed", "step", "none is given", "give --make N, --run or --score")
        options = command.ConcealedOptions(
            folder, library or library_folder(), make, legs, people, run, score, seed, processes
        )
        with progress_on() as progress:
            lines = command.run(options, progress)
        for line in lines:
            typer.echo(line)


if __name__ == "__main__":
    app(prog_name="python -m studies.concealed")

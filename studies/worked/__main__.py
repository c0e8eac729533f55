"""``python -m studies.worked``."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from legfem.commands.study import Jobs, Library, Out
from legfem.common.command_line import study_context


class WorkedExample(StrEnum):
    """What the base model leaves out."""

    STRAIN_STIFFENING = "strain-stiffening"
    END_EFFECTS = "end-effects"


app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command()
def worked(
    example: Annotated[list[WorkedExample] | None, typer.Option(help="Only this one; both by default.")] = None,
    library: Library = None,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Two worked diagnoses of what the first paper left out: strain stiffening and 3D ends.

    Recordings are simulated on another discretisation and diagnosed end to end. Solutions are kept
    as they are done: the same command goes on where it was stopped.

    Example: python -m studies.worked
    """
    resume = "run the same command again to go on; solutions that are done are kept"
    with study_context("worked", out, jobs, resume) as (folder, processes):
        from legfem.legs.variants import library_folder
        from studies.worked import command

        chosen = [entry.value for entry in example or WorkedExample]
        command.run(chosen, folder, library or library_folder(), processes)


if __name__ == "__main__":
    app(prog_name="python -m studies.worked")

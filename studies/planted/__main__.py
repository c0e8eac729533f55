"""``python -m studies.planted``."""

from __future__ import annotations

from typing import Annotated

import typer

from legfem.commands.study import Jobs, Out
from legfem.common.command_line import study_context

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command()
def planted(
    number: Annotated[int, typer.Option("--n", min=1, help="Number of truths.")] = 40,
    seed: Annotated[int, typer.Option(min=0, help="Of truths, noise and search.")] = 1,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Whether the intervals cover truths planted with another discretisation and noise.

    Example: python -m studies.planted --n 40
    """
    with study_context("planted", out, jobs) as (folder, processes):
        from studies.planted import command as planted_command

        planted_command.run(number, seed, folder, processes)


if __name__ == "__main__":
    app(prog_name="python -m studies.planted")

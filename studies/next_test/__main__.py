"""``python -m studies.next_test``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from legfem.commands.study import Jobs, Library, Out
from legfem.common.command_line import study_context
from legfem.common.progress import progress_on

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command()
def next_test(
    cases: Annotated[Path, typer.Option(help="Folder of sealed cases, diagnosed by studies.concealed.")] = Path(
        "results/concealed"
    ),
    most: Annotated[int, typer.Option(min=1, help="Ambiguous cases, by their numbers.")] = 40,
    seed: Annotated[int, typer.Option(min=0, help="Of the cases; opens the keys.")] = 1,
    library: Library = None,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Make tests that the plan proposes for ambiguous sealed cases (simulated), or one at random.

    A case's old recordings and the new ones are diagnosed together. Every case is kept as it is
    done: the same command goes on where it was stopped.

    Example: python -m studies.next_test --cases results/concealed --most 40 --seed 1
    """
    resume = "run the same command again to go on; what is done is kept"
    with study_context("next_test", out, jobs, resume) as (folder, processes):
        from legfem.legs.variants import library_folder
        from studies.next_test import command

        options = command.NextTestOptions(cases, folder, library or library_folder(), most, seed, processes)
        with progress_on() as progress:
            lines = command.run(options, progress)
        for line in lines:
            typer.echo(line)


if __name__ == "__main__":
    app(prog_name="python -m studies.next_test")

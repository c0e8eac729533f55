"""``python -m studies.people``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from legfem.commands.study import Jobs, Out
from legfem.common.command_line import study_context

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command()
def people(
    data: Annotated[Path, typer.Option(help="Folder with indentation.csv, the table of MULTIS.")] = Path(
        "../shared/data/multis_in_vivo"
    ),
    poisson_ratio: Annotated[
        float, typer.Option(min=0.3, max=0.4999, help="Of both tissues, which isn't known.")
    ] = 0.49,
    sliding: Annotated[bool, typer.Option("--sliding", help="Let the skin slide and stretch under the probe.")] = False,
    seed: Annotated[int, typer.Option(help="Of the draws.")] = 0,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Fit fat and muscle of living people, and predict each person from the others.

    Solutions are kept as they are done: the same command goes on where it was stopped.

    Example: python -m studies.people --data ../shared/data/multis_in_vivo
    """
    resume = "run the same command again to go on; solutions that are done are kept"
    with study_context("people", out, jobs, resume) as (folder, processes):
        from studies.people.command import run
        from studies.people.probe import ProbeModel

        model = ProbeModel(poisson_ratio, "frictionless" if sliding else "rough")
        run(data, model, folder, processes, seed)


if __name__ == "__main__":
    app(prog_name="python -m studies.people")

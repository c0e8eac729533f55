"""``python -m studies.solvers``."""

from __future__ import annotations

from typing import Annotated

import typer

from legfem.commands.study import Out
from legfem.common.command_line import end_without_a_solution, study_context

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command()
def solvers(
    sizes: Annotated[
        list[int] | None,
        typer.Option(
            "--size",
            min=2000,
            help="Unknowns; several may be given. 20000, 60000 and 200000 by default, or none with --tetrahedra.",
        ),
    ] = None,
    tetrahedra: Annotated[int, typer.Option(min=0, help="So many tetrahedra of first order.")] = 0,
    ranks: Annotated[list[int] | None, typer.Option(min=1, help="Ranks of MPI; several may be given.")] = None,
    direct_up_to: Annotated[
        int, typer.Option(min=0, help="Greatest size to factorise: time grows as its square.")
    ] = 200_000,
    step: Annotated[float, typer.Option(min=0.1, help="Of the load (mm).")] = 0.5,
    out: Out = None,
) -> None:
    """Measure factors and iterations in 3D: one load step by size, each in its own process.

    Starts mpirun itself where --ranks asks for it.

    Example: python -m studies.solvers --size 20000 --size 60000 --ranks 1 --ranks 2
    """
    resume = "run the same command again to go on; measured cases are kept"
    with study_context("solvers", out, None, resume) as (folder, _):
        from dataclasses import replace

        from studies.solvers import command as solvers_command

        cases = solvers_command.cases_of(
            sizes or ([] if tetrahedra else [20_000, 60_000, 200_000]), tetrahedra, ranks or [1], direct_up_to
        )
        if not solvers_command.run([replace(case, step=step) for case in cases], folder):
            end_without_a_solution("solvers")


if __name__ == "__main__":
    app(prog_name="python -m studies.solvers")

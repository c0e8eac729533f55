"""``python -m studies.solvers``."""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from legfem.common.command_line import end_without_a_solution, study_context
from legfem.common.documents import markdown_table, write_document
from legfem.common.errors import InputError
from legfem.common.progress import progress_on
from legfem.jobs.store import Store
from studies.command_line import DONE_IS_KEPT, Out, new_app, write_results
from studies.solvers.case import SolverCase, SolverWork, run_apart

Measured = dict[SolverCase, SolverWork | None]
"""None where the process ended without a result: killed, most often for its memory."""


def cases_of(sizes: Sequence[int], tetrahedra: int, ranks: Sequence[int], direct_up_to: int) -> list[SolverCase]:
    """Return the cases of a study, the smallest first."""
    pairs = [
        SolverCase(size, solver, ranks=number)
        for size in sorted(sizes)
        for solver in ("direct", "iterative")
        for number in ranks
        if solver == "iterative" or size <= direct_up_to
    ]
    linear = [SolverCase(tetrahedra, "iterative", "tetrahedra", ranks=number) for number in ranks]
    return pairs + (linear if tetrahedra else [])


def run(cases: Sequence[SolverCase], out: Path) -> bool:
    """Measure cases one after the other, each in processes of its own, and write the table.

    Returns whether any came to a result.

    Raises
    ------
    InputError
        If there are ranks to start and no mpirun.
    """
    if any(case.ranks > 1 for case in cases) and shutil.which("mpirun") is None:
        raise InputError("--ranks", "mpirun", "is not there", "measure on 1 rank")
    store = Store(out / "cases", SolverWork, modules=("studies.solvers.case",))
    measured: Measured = {}
    with progress_on() as progress:
        progress.stage("load steps", len(cases))
        for case in cases:
            work = store.get(case) or measured_apart(case)
            if work is not None:
                store.put(case, work)
            measured[case] = work
            progress.advance(f"{case.solver}, {case.cells}, {case.ranks} ranks, about {case.size}")
    found = [{"case": asdict(case), "work": asdict(work)} for case, work in measured.items() if work is not None]
    write_results(out, {"cases": found}, solvers_table(measured))
    return bool(found)


def measured_apart(case: SolverCase) -> SolverWork | None:
    """Measure a case in fresh processes; None if they end without a result."""
    # Another run's environment would keep mpirun from starting.
    inherited = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMIX"))}
    with TemporaryDirectory() as folder:
        given, result = Path(folder, "case.json"), Path(folder, "work.json")
        write_document(given, asdict(case))
        command = [sys.executable, "-m", "studies.solvers.case", str(given), str(result)]
        if case.ranks > 1:
            command = ["mpirun", "-n", str(case.ranks), *command]
        status = run_apart(command, {**inherited, "OMP_NUM_THREADS": "1"})
        return None if status or not result.is_file() else SolverWork(**json.loads(result.read_text()))


_COLUMNS = ("cells", "solver", "ranks", "unknowns", "nonzeros (M)", "tangents", "s a factorisation or solve")
_MORE = ("iterations: median (most)", "s the step", "by the clock", "peak (GiB)", "before solving")


def solvers_table(measured: Measured) -> str:
    """Return a row a case, in Markdown."""
    rows = []
    for case, work in measured.items():
        if work is None:
            rows.append([case.cells, case.solver, str(case.ranks), f"about {case.size}", "ended", *[""] * 7])
            continue
        iterates = case.solver == "iterative"
        counts = f"{median(work.iterations):.0f} ({max(work.iterations)})" if iterates else "-"
        tangents = f"{work.tangents}{'' if work.complete else ' (stopped)'}"
        sizes = f"{work.cells} {case.cells[:5]}.", case.solver, str(case.ranks), str(work.unknowns)
        seconds = f"{work.total_seconds:.1f}", f"{work.wall_seconds:.1f}"
        solves = f"{work.nonzeros / 1e6:.1f}", tangents, f"{work.linear_seconds:.2f}", counts
        rows.append([*sizes, *solves, *seconds, f"{work.peak_GiB:.2f}", f"{work.start_GiB:.2f}"])
    table = markdown_table([*_COLUMNS, *_MORE], rows)
    return f"{table}\nOne load step of the idealised leg, simulated; seconds of the processor.\n"


app = new_app()


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
    with study_context("solvers", out, None, DONE_IS_KEPT) as (folder, _):
        cases = cases_of(
            sizes or ([] if tetrahedra else [20_000, 60_000, 200_000]), tetrahedra, ranks or [1], direct_up_to
        )
        if not run([replace(case, step=step) for case in cases], folder):
            end_without_a_solution("solvers")


if __name__ == "__main__":
    app(prog_name="python -m studies.solvers")

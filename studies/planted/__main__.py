"""``python -m studies.planted``."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from legfem.common.command_line import study_context
from legfem.common.documents import write_document
from legfem.common.progress import progress_on
from legfem.jobs.pool import Workers
from legfem.jobs.store import Contents, Store, finish
from legfem.legs.schema import SUBJECTS
from studies.command_line import Jobs, Out, new_app
from studies.planted.truths import Planted, PlantedTruth, coverage, identify_truth, planted_truths


def run(number: int, seed: int, out: Path, jobs: int) -> None:
    """Identify planted truths, print the table and write it; a rerun goes on."""
    truths = planted_truths(number, seed, SUBJECTS.names)
    store = Store(out / "truths", Planted, modules=("studies.planted.truths",))
    with progress_on() as progress, Workers(identify_truth, None, jobs) as workers:
        found = finish(
            workers, truths, store, progress, "simulating and identifying", lambda _, case: _line(case), asked=_asked
        )
    document = {"schema": 1, "unit": "kPa", "origin": "simulated"}
    cases = [asdict(case) for case in found]
    path = write_document(out / "result.json", {**document, "cases": cases})
    Console(width=120).print(planted_table(found))
    for parameter in ("c10", "c20"):
        rate = coverage(found, parameter)
        low, high = rate.interval
        print(
            f"{parameter}: 95 % intervals cover {rate.share:.1%} of {number} truths "
            f"(95 % interval of that share: {low:.1%} to {high:.1%})"
        )
    print(f"result: {path}")


def _asked(truth: PlantedTruth) -> object:
    """Return what an outcome depends on: the truth, and the leg it is planted in."""
    return truth, Contents(SUBJECTS.find(truth.subject))


def planted_table(found: list[Planted]) -> Table:
    """Return a row a truth; a star marks an interval that misses."""
    table = Table(title="Planted truths (kPa), simulated data")
    for name in ("subject", "true C10", "C10", "95 %", "true C20", "C20", "95 %", "solves"):
        table.add_column(name, justify="right")
    for case in found:
        truth = case.truth
        table.add_row(
            truth.subject,
            f"{truth.c10_kpa:.3f}",
            f"{case.c10:.3f}",
            _interval(case.c10_interval, case.c10_covered),
            f"{truth.c20_kpa:.3f}",
            f"{case.c20:.3f}",
            _interval(case.c20_interval, case.c20_covered),
            str(case.forward_solves),
        )
    return table


def _interval(interval: tuple[float, float], covered: bool) -> str:
    return f"{interval[0]:.3f} to {interval[1]:.3f}{'' if covered else ' *'}"


def _line(case: Planted) -> str:
    return (
        f"C10 {case.truth.c10_kpa:.3f} -> {case.c10:.3f}, "
        f"C20 {case.truth.c20_kpa:.3f} -> {case.c20:.3f} kPa, {case.forward_solves} solves"
    )


app = new_app()


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
        run(number, seed, folder, processes)


if __name__ == "__main__":
    app(prog_name="python -m studies.planted")

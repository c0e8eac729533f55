"""``python -m studies.nulls``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from legfem.common.command_line import study_context
from legfem.common.errors import InputError
from legfem.common.progress import Progress, progress_on
from legfem.inverse.correction import read_correction
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.diagnosis import Diagnoser
from legfem.legs.finite_element_models import library_folder
from studies.command_line import DONE_IS_KEPT, Jobs, Library, Out, new_app, write_results
from studies.lab.outcomes import Rate
from studies.nulls.counting import CONDITIONS, NullCounter, NullOutcome, clean_folders, count, kept, null_tasks


def run(
    number: int,
    legs: int,
    only: Sequence[str],
    seed: int,
    crosscheck: Path,
    foreign: Path | None,
    library: Path,
    out: Path,
    jobs: int,
    progress: Progress,
) -> None:
    """Diagnose so many null recordings, and write and print what was found."""
    folders = clean_folders(crosscheck, foreign)
    counter = NullCounter(folders, Diagnoser(library, read_correction(REFERENCE), 1))
    names = [condition.name for condition in CONDITIONS]
    for name in only:
        if name not in names:
            raise InputError("--only", name, "is unknown", f"choose of {', '.join(names)}")
    tasks = null_tasks(number, tuple(folder.name for folder in folders), legs, seed)
    asked = [task for task in tasks if not only or task.condition in only]
    count(asked, counter, out, jobs, progress)
    found = kept(tasks, out)
    write_results(out, {"seed": seed, "recordings": [asdict(outcome) for outcome in found]}, page(found))


def page(found: Sequence[NullOutcome]) -> str:
    """Return the table of false alarms, and each of them."""
    lines = ["| errors | legs | false alarms (95 %) | C10 within its 95 % interval | called |", "|---|---|---|---|---|"]
    for condition in CONDITIONS:
        mine = [outcome for outcome in found if outcome.condition == condition.name]
        if mine:
            lines.append(_row(condition.name, mine))
    lines.append(_row("together", found))
    return "\n".join(lines) + "\n"


def _row(name: str, mine: Sequence[NullOutcome]) -> str:
    alarms = Counter(_called(outcome) for outcome in mine if outcome.false_alarm)
    legs = len({(outcome.condition, outcome.curve, outcome.leg) for outcome in mine})
    return (
        f"| {name} | {legs} | {Rate(sum(o.false_alarm for o in mine), len(mine))} | "
        f"{Rate(sum(o.covered for o in mine), len(mine))} | "
        + ", ".join(f"{called}: {times}" for called, times in alarms.most_common())
        + " |"
    )


def _called(outcome: NullOutcome) -> str:
    return " or ".join(" + ".join(names) for names in outcome.models) or outcome.verdict


app = new_app()


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
    with study_context("nulls", out, jobs, DONE_IS_KEPT) as (folder, processes):
        known = library or library_folder()
        with progress_on() as progress:
            run(n, legs, only or (), seed, crosscheck, foreign, known, folder, processes, progress)


if __name__ == "__main__":
    app(prog_name="python -m studies.nulls")

"""``python -m studies.redrawn``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from legfem.common.command_line import study_context
from legfem.common.documents import markdown_table
from legfem.common.errors import InputError
from legfem.common.progress import Progress, progress_on
from legfem.inverse.correction import read_correction
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.diagnosis import Diagnoser
from legfem.legs.finite_element_models import library_folder
from studies.command_line import DONE_IS_KEPT, Jobs, Library, Out, new_app, write_results
from studies.lab.outcomes import Rate
from studies.redrawn.drawing import Redrawer, RedrawnOutcome, RedrawnTask, cases_in, diagnose_each

_HEADER = (
    "case",
    "what is there",
    "sets",
    "said first",
    "listed",
    "explanations",
    "C10 within its interval",
    "half-width of C10",
    "C10 off: base model",
    "after",
    "said first",
)


def run(
    foreign: Path, number: int, only: Sequence[str], seed: int, library: Path, out: Path, jobs: int, progress: Progress
) -> None:
    """Diagnose so many sets of each case, and write and print what was found."""
    names = list(cases_in(foreign))
    for name in only:
        if name not in names:
            raise InputError("--only", name, "is no case there", f"choose of {', '.join(names)}")
    tasks = [RedrawnTask(name, k, seed) for k in range(number) for name in only or names]
    redrawer = Redrawer(foreign, Diagnoser(library, read_correction(REFERENCE), 1))
    found = diagnose_each(tasks, redrawer, out, jobs, progress)
    write_results(out, {"seed": seed, "recordings": [asdict(outcome) for outcome in found]}, page(found))


def page(found: Sequence[RedrawnOutcome]) -> str:
    """Return the table of cases."""
    rows = []
    for case in dict.fromkeys(outcome.case for outcome in found):
        mine = [outcome for outcome in found if outcome.case == case]
        rows.append(_row(case, " + ".join(mine[0].effects) or "nothing", mine))
    effects = [outcome for outcome in found if outcome.effects]
    rows += [_row("all with an effect", "", effects)] if effects else []
    return markdown_table(_HEADER, [*rows, _row("all", "", found)])


def _row(case: str, there: str, mine: Sequence[RedrawnOutcome]) -> list[str]:
    def median(values: Sequence[float]) -> str:
        return f"{100 * float(np.median(np.abs(values))):.1f} %"

    said = Counter(
        "something unknown" if unknown else " + ".join(names) or "nothing that shows"
        for names, unknown, _ in (outcome.statements[0] for outcome in mine)
    )
    return [
        case,
        there,
        str(len(mine)),
        str(Rate(sum(o.first for o in mine), len(mine))),
        str(Rate(sum(o.listed for o in mine), len(mine))),
        f"{np.median([len(o.models) for o in mine]):g}",
        str(Rate(sum(o.covered for o in mine), len(mine))),
        median([(o.interval[1] - o.interval[0]) / (2 * o.true_c10) for o in mine]),
        median([o.base_c10 / o.true_c10 - 1 for o in mine]),
        median([o.c10 / o.true_c10 - 1 for o in mine]),
        ", ".join(f"{name}: {times}" for name, times in said.most_common()),
    ]


app = new_app()


@app.command()
def redrawn(
    foreign: Annotated[Path, typer.Option(help="Folder of another code's cases, with truth.json.")],
    n: Annotated[int, typer.Option("--n", min=1, help="Sets of recordings of each case.")] = 6,
    only: Annotated[list[str] | None, typer.Option(help="Cases; all without it. May be given again.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of all draws.")] = 1,
    library: Library = None,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Diagnose another code's legs with effects, recorded anew with errors as labs have them.

    A case is a subject folder with clean.csv, the code's own course of each trial. Every diagnosis
    is kept as it is done: the same command goes on where it was stopped.

    Example: python -m studies.redrawn --foreign ../shared/foreign --n 6
    """
    with study_context("redrawn", out, jobs, DONE_IS_KEPT) as (folder, processes), progress_on() as progress:
        run(foreign, n, only or (), seed, library or library_folder(), folder, processes, progress)


if __name__ == "__main__":
    app(prog_name="python -m studies.redrawn")

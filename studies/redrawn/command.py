"""What ``python -m studies.redrawn`` does and writes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from legfem.common.documents import markdown_table
from legfem.common.errors import InputError
from legfem.common.progress import Progress
from legfem.legs.correction import read_correction
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.diagnosis import Diagnoser
from studies.lab.outcomes import written
from studies.lab.rate import Rate
from studies.redrawn.drawing import Redrawer, RedrawnOutcome, RedrawnTask, diagnose_each
from studies.redrawn.foreign import cases_in

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
) -> list[str]:
    """Diagnose so many sets of each case; return lines for the terminal."""
    names = list(cases_in(foreign))
    for name in only:
        if name not in names:
            raise InputError("--only", name, "is no case there", f"choose of {', '.join(names)}")
    tasks = [RedrawnTask(name, k, seed) for k in range(number) for name in only or names]
    redrawer = Redrawer(foreign, Diagnoser(library, read_correction(REFERENCE), 1))
    found = diagnose_each(tasks, redrawer, out, jobs, progress)
    return written(out, seed, found, page(found))


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

"""What ``python -m studies.nulls`` does and writes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from legfem.common.errors import InputError
from legfem.common.progress import Progress
from legfem.legs.correction import read_correction
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.diagnosis import Diagnoser
from studies.lab.outcomes import written
from studies.lab.rate import Rate
from studies.nulls.conditions import CONDITIONS, null_tasks
from studies.nulls.counting import NullCounter, NullOutcome, count, kept
from studies.nulls.curves import clean_folders


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
) -> list[str]:
    """Diagnose so many null recordings; return lines for the terminal."""
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
    return written(out, seed, found, page(found))


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

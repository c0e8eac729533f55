"""``python -m studies.next_test``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from legfem.common.command_line import study_context
from legfem.common.documents import markdown_table
from legfem.common.errors import InputError
from legfem.common.progress import Progress, progress_on
from legfem.inverse.correction import read_correction
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, finish
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.diagnosis import Diagnoser
from legfem.legs.finite_element_models import library_folder
from studies.command_line import DONE_IS_KEPT, Jobs, Library, Out, new_app, write_results
from studies.concealed.diagnosing import asked, case_folders, diagnoses
from studies.lab.outcomes import Rate
from studies.next_test.trying import Lab, Outcome, Tried, try_case


def page(tried: Sequence[Tried]) -> str:
    """Return the page in Markdown."""
    whole = [t for t in tried if t.proposed is not None and t.random is not None]
    differ = [t for t in whole if t.proposed.design != t.random.design]  # type: ignore[union-attr]
    rows = [
        ("ambiguous cases tried, all simulated", f"{len(whole)} of {len(tried)}"),
        ("the proposed test left one explanation", _rate(whole, "proposed", _ended)),
        ("... and it is what was concealed", _rate(whole, "proposed", _right)),
        ("a random one of the same tests left one explanation", _rate(whole, "random", _ended)),
        ("... and it is what was concealed", _rate(whole, "random", _right)),
        ("cases in which both tests differ", str(len(differ))),
        ("of these: the proposed one left one explanation", _rate(differ, "proposed", _ended)),
        ("of these: the random one did", _rate(differ, "random", _ended)),
        ("chance that the plan reckoned for its proposal, mean", _mean(whole, "proposed")),
        ("for the random one, mean", _mean(whole, "random")),
    ]
    return "\n".join([markdown_table(["", ""], rows), _cases(tried)])


def _ended(outcome: Outcome) -> bool:
    return outcome.ended


def _right(outcome: Outcome) -> bool:
    return outcome.right


def _rate(tried: Sequence[Tried], which: str, holds: Callable[[Outcome], bool]) -> str:
    return str(Rate(sum(holds(getattr(t, which)) for t in tried), len(tried)))


def _mean(tried: Sequence[Tried], which: str) -> str:
    chances = [getattr(t, which).chance for t in tried]
    return f"{np.mean(chances):.0%}" if chances else "no case"


def _cases(tried: Sequence[Tried]) -> str:
    rows = [
        (str(t.number), " + ".join(t.concealed), _or(t.before), _told(t.proposed, t.why), _told(t.random, ""))
        for t in tried
    ]
    return markdown_table(["case", "concealed", "open before", "proposed", "random"], rows)


def _told(outcome: Outcome | None, why: str) -> str:
    if outcome is None:
        return why
    mark = " (right)" if outcome.right else ""
    left = _or(outcome.models) if outcome.models else ""
    return f"{outcome.design} ({outcome.chance:.0%}): {outcome.verdict} {left}{mark}".strip()


def _or(models: Sequence[Sequence[str]]) -> str:
    return " or ".join(" + ".join(names) for names in models)


@dataclass(frozen=True)
class NextTestOptions:
    """What is asked for."""

    cases: Path
    out: Path
    library: Path
    most: int
    seed: int
    jobs: int


def run(options: NextTestOptions, progress: Progress) -> None:
    """Try the ambiguous cases, and write and print what came of them.

    Raises
    ------
    InputError
        If no case was called ambiguous by this code.
    """
    correction = read_correction(REFERENCE)
    diagnoser = Diagnoser(options.library, correction, 1)
    folders = _ambiguous(options.cases, diagnoser)[: options.most]
    if not folders:
        raise InputError(
            options.cases,
            "diagnoses",
            "none by this code is ambiguous",
            "run python -m studies.concealed --run on this folder first",
        )
    lab = Lab(options.cases, options.out / "work", diagnoser, options.seed)
    store = Store(
        options.out / "tried",
        Tried,
        (correction, options.seed),
        ("studies.next_test.trying", "legfem.legs.diagnosis"),
        named=lambda one: one[0],
    )
    with Workers(try_case, lab, options.jobs) as workers:
        tried = finish(workers, folders, store, progress, "trying the next test", _line, asked)
    write_results(options.out, {"cases": [asdict(one) for one in tried]}, page(tried))


def _ambiguous(cases: Path, diagnoser: Diagnoser) -> list[Path]:
    """Return the folders of cases that were called ambiguous, in the order of their numbers."""
    store = diagnoses(cases, diagnoser)
    known = ((folder, store.get(asked(folder))) for folder in case_folders(cases))
    return [folder for folder, found in known if found is not None and found["verdict"] == "ambiguous"]


def _line(folder: Path, tried: Tried) -> str:
    if tried.proposed is None or tried.random is None:
        return f"{folder.name}: {tried.why}"
    return f"{folder.name}: {tried.proposed.line}; at random {tried.random.line}"


app = new_app()


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
    with study_context("next_test", out, jobs, DONE_IS_KEPT) as (folder, processes):
        options = NextTestOptions(cases, folder, library or library_folder(), most, seed, processes)
        with progress_on() as progress:
            run(options, progress)


if __name__ == "__main__":
    app(prog_name="python -m studies.next_test")

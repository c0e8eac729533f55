"""``python -m studies.sealed_channels``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
import typer

from legfem.common.command_line import study_context
from legfem.common.progress import progress_on
from legfem.data import segment_all
from legfem.inverse.observations import observe
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store
from legfem.legs.correction import read_correction
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.diagnosis import Diagnoser
from legfem.legs.variants import library_folder
from studies.command_line import DONE_IS_KEPT, Jobs, Library, Out, new_app, write_results
from studies.concealed.cases import sealed_leg
from studies.lab.outcomes import Rate
from studies.lab.recording import INSTRUMENT
from studies.sealed_channels.cases import SUBSETS, channel_cases, made
from studies.sealed_channels.diagnosing import Lab, Said, Task, diagnosed


def table(said: Sequence[Said]) -> str:
    """Return what is right by channels and by case, in Markdown."""
    lines = [
        "| channels | named first | listed | pairs first | outside unknown | false alarms | F1 of names | C10 held "
        "| half-width, median | said with 0.8 or more and right |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for subset in SUBSETS:
        mine = [one for one in said if one.subset == subset]
        by_kind = {kind: [one for one in mine if one.kind == kind] for kind in ("none", "single", "pair", "outside")}
        named = [*by_kind["single"], *(one for one in by_kind["outside"] if one.truth)]
        unknown = [one for one in by_kind["outside"] if not one.truth]
        sure = [one for one in mine if one.probability >= 0.8]
        cells = [
            subset,
            _rate([one.right for one in named]),
            _rate([one.in_list for one in named]),
            _rate([one.right for one in by_kind["pair"]]),
            _rate([one.right for one in unknown]),
            _rate([not one.right for one in by_kind["none"]]),
            f"{names_f1(mine):.2f}",
            _rate([one.holds for one in mine]),
            f"{100 * float(np.median([one.half_width for one in mine])):.0f} %" if mine else "",
            _rate([one.right for one in sure]),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    lines += ["", "| case | truth | " + " | ".join(SUBSETS) + " |", "|---|---|" + "---|" * len(SUBSETS)]
    for number in sorted({one.case for one in said}):
        row = {one.subset: one for one in said if one.case == number}
        some = next(iter(row.values()))
        truth = "+".join(some.truth) or some.kind
        cells = [_cell(row[subset]) if subset in row else "" for subset in SUBSETS]
        lines.append(f"| {number} | {truth}, C10 {some.true_c10:.2f} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def names_f1(said: Sequence[Said]) -> float:
    """Return the F1 of the names in the first things said: of effects that were there, and of names that were right."""
    right = sum(len(set(one.first) & set(one.truth)) for one in said)
    either = sum(len(one.first) + len(one.truth) for one in said)
    return 2 * right / either if either else 1.0


def _rate(which: Sequence[bool]) -> str:
    return str(Rate(sum(which), len(which)))


def _cell(one: Said) -> str:
    names = " or ".join("+".join(n) for n in one.listed[:2]) or one.verdict
    return f"{'**' if one.right else ''}{names}{'**' if one.right else ''}; {one.c10[0]:.2f} to {one.c10[1]:.2f}"


app = new_app()


@app.command()
def sealed_channels(
    cases: Annotated[int, typer.Option(min=1, help="Sealed recordings.")] = 24,
    leg: Annotated[int, typer.Option(min=0, help="Number of the leg; each costs a library of responses.")] = 0,
    seed: Annotated[int, typer.Option(min=0, help="Of the cases.")] = 36,
    library: Library = None,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Diagnose the same sealed recordings by force alone, and with further channels.

    Example: python -m studies.sealed_channels --cases 24
    """
    with study_context("sealed_channels", out, jobs, DONE_IS_KEPT) as (folder, processes), progress_on() as progress:
        kept, correction = library or library_folder(), read_correction(REFERENCE)
        diagnoser, stated = Diagnoser(kept, correction, processes), sealed_leg(leg, seed).stated
        with Workers(made, (seed, kept, correction), processes) as workers:
            made_cases = channel_cases(cases, seed, leg)
            progress.stage("simulating sealed cases", len(made_cases))
            recorded = {}
            for case, recordings in workers.run(made_cases):
                recorded[case.number] = case, recordings
                progress.advance(case.name + ("" if recordings is not None else ": LEFT OUT, a solution stopped"))
        # Loadings alone: one library serves all cases, whatever their depths.
        first = next(recordings for _, (_, recordings) in sorted(recorded.items()) if recordings is not None)
        observed = observe(segment_all(first, INSTRUMENT, False))
        lab = Lab(correction, leg, seed, diagnoser.library(stated, observed, progress)[0])
        modules = ("legfem.legs.diagnosis", "studies.sealed_channels.cases")
        store = Store(folder / "said", Said, (leg, seed), modules)
        tasks = [
            Task(case, subset, recordings)
            for _, (case, recordings) in sorted(recorded.items())
            if recordings is not None
            for subset in SUBSETS
        ]
        said = [one for task in tasks if (one := store.get(task.asked)) is not None]
        waiting = [task for task in tasks if store.get(task.asked) is None]
        progress.stage("diagnosing", len(waiting))
        with Workers(diagnosed, lab, processes) as workers:
            for task, one in workers.run(waiting):
                store.put(task.asked, one)
                said.append(one)
                progress.advance(f"{task.case.name} {task.subset}: {_cell(one)} ({one.seconds:.0f} s)")
        document: Mapping[str, Any] = {"cases": [one.__dict__ for one in said]}
        write_results(folder, document, table(said))


if __name__ == "__main__":
    app(prog_name="python -m studies.sealed_channels")

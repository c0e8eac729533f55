"""``python -m studies.fibrous_specimens``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Annotated, Literal

import numpy as np
import typer

from legfem.common.command_line import study_context
from legfem.common.documents import markdown_table
from legfem.common.progress import progress_on
from legfem.inverse.intervals import VERDICTS
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, finish
from studies.command_line import DONE_IS_KEPT, Jobs, Out, new_app, write_results
from studies.fibrous_specimens.planting import RATIOS, SETUPS, Found, Outcome, Plant, Setup, identified, plants
from studies.lab.outcomes import Rate

app = new_app()


@app.command()
def fibrous_specimens(
    n: Annotated[int, typer.Option("--n", min=1, help="Tissues.")] = 30,
    seed: Annotated[int, typer.Option(min=0, help="Of truths and errors.")] = 1,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Identify planted fibrous tissue from bars along its fibres, across them, and both.

    Example: python -m studies.fibrous_specimens --n 30
    """
    with study_context("fibrous-specimens", out, jobs, DONE_IS_KEPT) as (folder, processes):
        modules = ("studies.fibrous_specimens.planting",)
        store = Store(folder / "tissues", Outcome, modules=modules)
        with progress_on() as progress, Workers(identified, folder, processes) as workers:
            found = finish(workers, plants(n, seed), store, progress, "pulling and identifying", _line)
        write_results(folder, {"seed": seed, "tissues": [asdict(one) for one in found]}, page(found))


def page(found: Sequence[Outcome]) -> str:
    """Return the tables of what is covered and what is told, by setup and ratio."""
    return "\n".join([_table(found, "C10"), "", _table(found, "ratio"), "", "Simulated data.", ""])


def _table(found: Sequence[Outcome], name: Literal["C10", "ratio"]) -> str:
    rows = []
    for setup in SETUPS:
        for ratio in (None, *RATIOS):
            chosen = [one for one in found if ratio in (None, one.plant.ratio)]
            if not chosen:
                continue
            pairs = [_beside_truth(one, setup, name) for one in chosen]
            covers = sum(one.interval.covers(true) for one, true in pairs)
            half = [0.5 * one.interval.width / true for one, true in pairs]
            words = [one.word for one, _ in pairs]
            warned = sum(one.warned[setup.title] for one in chosen)
            rows.append(
                [
                    setup.title if ratio is None else "",
                    "all" if ratio is None else f"{ratio:g}",
                    str(Rate(covers, len(pairs))),
                    f"{np.median(half):.2f}",
                    "/".join(str(words.count(word)) for word in VERDICTS),
                    f"{warned}/{len(chosen)}",
                ]
            )
    head = [
        "bars",
        "planted ratio",
        f"{name}'s interval holds the truth",
        "half its width",
        "/".join(VERDICTS),
        "warned",
    ]
    return markdown_table(head, rows)


def _beside_truth(one: Outcome, setup: Setup, name: Literal["C10", "ratio"]) -> tuple[Found, float]:
    if name == "C10":
        return one.c10[setup.title], one.plant.c10_kpa
    return one.ratio[setup.title], one.plant.ratio


def _line(plant: Plant, one: Outcome) -> str:
    last = SETUPS[-2].title
    c10, ratio = one.c10[last].interval, one.ratio[last].interval
    return (
        f"tissue {plant.number}: C10 {plant.c10_kpa:.2f} -> {c10.value:.2f} kPa, ratio "
        f"{plant.ratio:g} -> {ratio.value:.2f}"
    )


if __name__ == "__main__":
    app(prog_name="python -m studies.fibrous_specimens")

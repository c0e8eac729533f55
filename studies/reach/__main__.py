"""``python -m studies.reach``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Annotated

import numpy as np
import typer

from legfem.common.command_line import end_without_a_solution, study_context
from legfem.common.documents import markdown_table
from legfem.common.progress import progress_on
from studies.command_line import DONE_IS_KEPT, Jobs, Out, new_app, write_results
from studies.lab.outcomes import Rate
from studies.reach.pressing import Reached, ReachTask, press_all

WITHIN = 0.003

app = new_app()


@app.command()
def reach(
    n: Annotated[int, typer.Option("--n", min=1, help="Legs.")] = 500,
    seed: Annotated[int, typer.Option(min=0, help="Of all draws.")] = 1,
    compare: Annotated[int, typer.Option(min=0, help="Every so manieth leg is solved with finer steps too.")] = 10,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Press random legs to 30 mm, or to 80 % of the way to the bone, and count which get there.

    Every leg is kept as it is done: the same command goes on where it was stopped.

    Example: python -m studies.reach --n 20
    """
    with study_context("reach", out, jobs, DONE_IS_KEPT) as (folder, processes):
        tasks = [ReachTask(k, seed, compare > 0 and k % compare == 0) for k in range(n)]
        with progress_on() as progress:
            found = press_all(tasks, folder, processes, progress)
        legs = [{"number": task.number, **asdict(outcome)} for task, outcome in found]
        write_results(folder, {"seed": seed, "legs": legs}, page(found))
        if not any(outcome.complete for _, outcome in found):
            end_without_a_solution("reach")


def page(found: Sequence[tuple[ReachTask, Reached]]) -> str:
    """Return what was reached, what not and why, and how good the curves are."""
    outcomes = [outcome for _, outcome in found]
    compared = [outcome for outcome in outcomes if outcome.between is not None]
    between = [outcome.between for outcome in compared if outcome.between is not None]
    at_steps = [outcome.at_steps for outcome in compared if outcome.at_steps is not None]
    seconds = [outcome.seconds for outcome in outcomes]
    reached = [outcome for outcome in outcomes if outcome.complete]
    rows = [
        ["reached their depth", str(Rate(len(reached), len(outcomes)))],
        ["of them at the first attempt", f"{sum(o.attempts == 1 for o in reached)}"],
        ["of them with a jump to another equilibrium", f"{sum(o.jumps > 0 for o in reached)}"],
        [
            "curve within 0.3 % of finer steps, of those compared",
            str(Rate(sum(error <= WITHIN for error in between), len(between))),
        ],
        ["greatest difference", _percent(between)],
        ["greatest difference at the curve's own steps", _percent(at_steps)],
        ["seconds of the processor a leg, median and most", f"{np.median(seconds):.1f}, {max(seconds):.0f}"],
    ]
    text = markdown_table(["simulated legs", ""], rows)
    stopped = [
        [str(task.number), f"{o.reached_mm:.2f}", _described(o), o.reason] for task, o in found if not o.complete
    ]
    if stopped:
        heads = ["leg that stops short", "at (mm)", "what it is", "why"]
        text += "\n" + markdown_table(heads, stopped)
    return text


def _percent(errors: Sequence[float]) -> str:
    return f"{100 * max(errors):.2f} %" if errors else "none compared"


def _described(outcome: Reached) -> str:
    leg = outcome.leg
    if leg is None:
        return "not meshed"
    return (
        f"{leg.depth_mm:.1f} mm asked for, C10 {leg.C10_kPa:.2g}, C20 {leg.C20_kPa:.2g}, "
        f"fat {leg.fat_kPa:.2g}, fascia {leg.fascia_kPa:.2g} kPa of {leg.fascia_mm:.2g} mm"
    )


if __name__ == "__main__":
    app(prog_name="python -m studies.reach")

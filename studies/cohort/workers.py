"""``python -m studies.cohort.workers``."""

from __future__ import annotations

import heapq
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from legfem.common.command_line import study_context
from legfem.common.documents import markdown_table
from studies.command_line import DONE_IS_KEPT, Out, Seed, new_app, write_results

app = new_app()


@app.command()
def workers_idle(
    times: Annotated[Path, typer.Argument(help="A cohort.csv, whose seconds are drawn from.")],
    legs: Annotated[int, typer.Option(min=1, help="Tasks.")] = 1000,
    workers: Annotated[int, typer.Option(min=1, help="That do one at a time.")] = 100,
    starting_s: Annotated[float, typer.Option(min=0, help="Of a worker's first imports and forms.")] = 15.0,
    seed: Seed = 1,
    out: Out = None,
) -> None:
    """Simulate how long workers are idle, where each takes the next leg, by times as they were measured.

    Example: python -m studies.cohort.workers results/cohort-study/cohort.csv
    """
    with study_context("cohort-workers", out, 1, DONE_IS_KEPT) as (folder, _):
        table = pd.read_csv(times)
        measured = table["seconds"].dropna().to_numpy()
        rows = []
        for count in sorted({1, 2, 10, workers}):
            # Weak scaling: as many legs a worker.
            each = max(1, round(legs * count / workers))
            drawn = np.random.default_rng(seed).choice(measured, each)
            ends = [starting_s] * min(count, each)
            for seconds in drawn:
                heapq.heapreplace(ends, ends[0] + seconds)
            span = max(ends)
            busy = float(drawn.sum())
            rows.append(
                [
                    f"{count}",
                    f"{each}",
                    f"{span:.0f}",
                    f"{100 - 100 * busy / (count * span):.1f} %",
                    f"{each / span:.2f}",
                ]
            )
        header = ["workers", "legs", "seconds", "idle, with starting", "rows a second for the store"]
        write_results(folder, {"rows": rows, "measured": len(measured)}, markdown_table(header, rows))


if __name__ == "__main__":
    app(prog_name="python -m studies.cohort.workers")

"""``python -m studies.channels``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Annotated

import numpy as np
import typer

from legfem.common.command_line import study_context
from legfem.common.documents import markdown_table
from legfem.common.progress import progress_on
from studies.channels.layers import LAYERS, Body, Identified, LayersOutcome, drawn, each
from studies.command_line import DONE_IS_KEPT, Jobs, Out, Seed, new_app, write_results
from studies.lab.outcomes import Rate

_WORDS = {"deep.C10": "muscle's C10", "superficial.C10": "fat's C10"}
_HEADER = (
    "from",
    "of",
    "interval holds the truth",
    "off: median",
    "9 of 10 within",
    "within 10 %",
    "half-width, median",
    "share of the thicknesses, median",
)


def page(found: Sequence[LayersOutcome]) -> str:
    """Return the tables."""
    rows = []
    for words, of in (("force alone", "alone"), ("force and both thicknesses", "together")):
        for k, name in enumerate(LAYERS):
            rows.append([words, _WORDS[name], *_row(found, [getattr(one, of) for one in found], k)])
    legs = [_leg(one) for one in found]
    header = ("body", "muscle (kPa)", "found", "95 %", "fat (kPa)", "found", "95 %", "depth (mm)", "fit's probability")
    return "\n".join([markdown_table(_HEADER, rows), markdown_table(header, legs)])


def _row(found: Sequence[LayersOutcome], results: Sequence[Identified], k: int) -> list[str]:
    truths = np.array([one.truth.true(LAYERS[k]) for one in found])
    off = np.abs(np.array([one.values[k] for one in results]) / truths - 1)
    ends = np.array([one.intervals[k] for one in results])
    held = int(np.sum((ends[:, 0] <= truths) & (truths <= ends[:, 1])))
    width = (ends[:, 1] - ends[:, 0]) / (2 * truths)
    return [
        str(Rate(held, len(found))),
        f"{100 * np.median(off):.1f} %",
        f"{100 * np.quantile(off, 0.9):.1f} %",
        str(Rate(int(np.sum(off < 0.1)), len(found))),
        f"{100 * np.median(width):.1f} %",
        f"{100 * np.median([one.shares[k] for one in results]):.0f} %",
    ]


def _leg(one: LayersOutcome) -> list[str]:
    cells = [str(one.truth.number)]
    for k, name in enumerate(LAYERS):
        low, high = one.together.intervals[k]
        cells += [f"{one.truth.true(name):.3g}", f"{one.together.values[k]:.3g}", f"{low:.3g} to {high:.3g}"]
    return [*cells, f"{one.depth:.3g}", f"{one.together.p_value:.2g}"]


app = new_app()


@app.command()
def channels(
    body: Annotated[Body, typer.Option(help="What is pressed.")] = "limb",
    n: Annotated[int, typer.Option("--n", min=1, help="Bodies.")] = 30,
    seed: Seed = 1,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Identify both layers of bodies that another code pressed, from force alone and with ultrasound.

    Every body is kept as it is done: the same command goes on where it was stopped.

    Example: python -m studies.channels --n 30
    """
    with study_context(f"channels-{body}", out, jobs, DONE_IS_KEPT) as (folder, processes), progress_on() as progress:
        found = each(drawn(n, seed, body), folder, processes, progress)
        write_results(folder, {"seed": seed, "body": body, "cases": [asdict(one) for one in found]}, page(found))


if __name__ == "__main__":
    app(prog_name="python -m studies.channels")

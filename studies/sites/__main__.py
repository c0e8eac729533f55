"""``python -m studies.sites``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Annotated

import numpy as np
import typer

from legfem.common.command_line import study_context
from legfem.common.documents import markdown_table
from legfem.common.progress import progress_on
from legfem.inverse.catalogue import DEEP_C10
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, finish
from studies.command_line import DONE_IS_KEPT, Jobs, Out, new_app, write_results
from studies.lab.outcomes import Rate
from studies.sites.identifying import FAT, PARAMETERS, FoundLeg, Interval, identified
from studies.sites.planted import LEAST_MM, Truth, truths

app = new_app()


@app.command()
def sites(
    n: Annotated[int, typer.Option("--n", min=1, help="Legs.")] = 6,
    seed: Annotated[int, typer.Option(min=0, help="Of truths and errors.")] = 1,
    depth: Annotated[float, typer.Option(min=LEAST_MM, help="To press to (mm).")] = 12.0,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Identify legs from three sites together and from each, where the truth is known.

    Every solve is kept: the same command goes on where it was stopped.

    Example: python -m studies.sites --n 6
    """
    with study_context("sites", out, jobs, DONE_IS_KEPT) as (folder, processes):
        store = Store(folder / "legs", FoundLeg, modules=("studies.sites.identifying",))
        with progress_on() as progress, Workers(identified, folder, processes) as workers:
            found = finish(workers, truths(n, seed, depth), store, progress, "recording and identifying", _line)
        document = {"unit": "kPa", "seed": seed, "legs": [asdict(one) for one in found]}
        write_results(folder, document, page(found))


def page(found: Sequence[FoundLeg]) -> str:
    """Return the table of legs, and what all of them say."""
    rows = []
    for one in found:
        truth = _truths(one.truth)
        cells = [f"{one.truth.number}", "felupe" if one.truth.by_other_code else "legfem, finer"]
        for name in PARAMETERS:
            both = one.together[name], one.best_alone(name)
            cells += [f"{truth[name]:.3f}", *(_shown(i, truth[name]) for i in both)]
        rows.append([*cells, f"{one.agreement_p:.2f}"])
    head = ["leg", "pressed by"]
    for name in ("C10", "C20"):
        head += [f"{name} (kPa)", "three sites", "best single site"]
    lines = [markdown_table([*head, "p of agreement"], rows), ""]
    lines.append("A star marks an interval (95 %) that misses. Simulated data.")
    for name in (*PARAMETERS, FAT):
        lines.append("")
        lines.append(_summary(found, name))
    return "\n".join(lines) + "\n"


def _summary(found: Sequence[FoundLeg], name: str) -> str:
    ratios = [one.together[name].width / one.best_alone(name).width for one in found]
    joint = [one.together[name].covers(_truths(one.truth)[name]) for one in found]
    single = [alone[name].covers(_truths(one.truth)[name]) for one in found for alone in one.alone.values()]
    narrower = sum(ratio < 1 for ratio in ratios)
    return (
        f"{name}: joint intervals cover {Rate(sum(joint), len(joint))}, those of single sites "
        f"{Rate(sum(single), len(single))}; the joint one is narrower than the best single one in "
        f"{narrower} of {len(ratios)}, {np.median(ratios):.2f} of its width in the median "
        f"({min(ratios):.2f} to {max(ratios):.2f})."
    )


def _truths(truth: Truth) -> dict[str, float]:
    return dict(zip((*PARAMETERS, FAT), (truth.c10, truth.c20, truth.fat), strict=True))


def _shown(one: Interval, truth: float) -> str:
    return f"{one.low:.3f} to {one.high:.3f}{'' if one.covers(truth) else ' *'}"


def _line(truth: Truth, one: FoundLeg) -> str:
    return f"leg {truth.number}: C10 {truth.c10:.3f} -> {one.together[DEEP_C10].value:.3f} kPa"


if __name__ == "__main__":
    app(prog_name="python -m studies.sites")

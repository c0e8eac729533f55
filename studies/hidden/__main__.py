"""``python -m studies.hidden``."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer

from legfem.common.command_line import study_context
from legfem.common.progress import progress_on
from legfem.legs.correction import read_correction
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.diagnosis import Diagnoser
from legfem.legs.variants import library_folder
from studies.command_line import DONE_IS_KEPT, Jobs, Library, Out, Seed, new_app, write_results
from studies.hidden.cases import Recorder, cases_of
from studies.hidden.diagnosing import HiddenDiagnoser, diagnose, page, store_of

app = new_app()


@app.command()
def hidden(
    n: Annotated[int, typer.Option("--n", min=1, help="Cases.")] = 100,
    legs: Annotated[int, typer.Option(min=1, help="Legs that are drawn.")] = 6,
    seed: Seed = 1,
    library: Library = None,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Diagnose another code's recordings of effects that a refit of C10 hides, and of none.

    Example: python -m studies.hidden --n 9 --legs 1
    """
    with study_context("hidden", out, jobs, DONE_IS_KEPT) as (folder, processes):
        cases = cases_of(n, legs, seed)
        diagnoser = Diagnoser(library or library_folder(), read_correction(REFERENCE), 1)
        with progress_on() as progress:
            diagnose(cases, HiddenDiagnoser(Recorder(folder, seed), diagnoser), folder, processes, progress)
        kept = [store_of(folder).get(case) for case in cases]
        found = [one for one in kept if one is not None]
        write_results(folder, {"seed": seed, "recordings": [asdict(one) for one in found]}, page(found))


if __name__ == "__main__":
    app(prog_name="python -m studies.hidden")

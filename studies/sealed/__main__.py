"""``python -m studies.sealed``."""

from __future__ import annotations

from typing import Annotated

import typer

from legfem.common.command_line import study_context
from legfem.common.documents import json_types
from legfem.common.errors import InputError
from legfem.common.progress import progress_on
from legfem.inverse.correction import read_correction
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, finish
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.finite_element_models import library_folder
from studies.command_line import DONE_IS_KEPT, Jobs, Library, Out, Seed, new_app, write_results
from studies.concealed.cases import SealedCase
from studies.sealed.cases import SUBSETS, channel_cases
from studies.sealed.diagnosing import Lab, Said, said_each
from studies.sealed.page import cell_of, page

MODULES = ("legfem.legs.diagnosis", "legfem.report.diagnosis_headline", "studies.sealed.diagnosing")
app = new_app()


@app.command()
def sealed(
    legs: Annotated[int, typer.Option(min=1, help="Legs; each costs a library of responses.")] = 5,
    most: Annotated[int, typer.Option(min=1, help="Cases of each leg, of those that there are.")] = 100,
    channels: Annotated[
        list[str] | None,
        typer.Option(help=f"One of {', '.join(SUBSETS)}: what is diagnosed by; may be given again. All by default."),
    ] = None,
    confirm: Annotated[
        bool, typer.Option("--confirm", help="Confirm by full solutions, as `legfem diagnose` does; takes far longer.")
    ] = False,
    seed: Seed = 1,
    library: Library = None,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Diagnose the same sealed recordings by force alone, with further channels, and with holds.

    Example: python -m studies.sealed --legs 5 --seed 1
    """
    with study_context("sealed", out, jobs, DONE_IS_KEPT) as (folder, processes), progress_on() as progress:
        if unknown := set(channels or ()) - set(SUBSETS):
            raise InputError("--channels", sorted(unknown)[0], "is not one of them", f"give {', '.join(SUBSETS)}")
        lab = Lab(library or library_folder(), read_correction(REFERENCE), seed, confirm)
        subsets = [name for name in SUBSETS if not channels or name in channels]
        store = Store(folder / "said", list[Said], [seed, confirm, subsets], MODULES)
        every: list[Said] = []
        for leg in range(legs):
            cases = [case for case in channel_cases(legs, seed) if case.leg == leg][:most]
            waiting = [case for case in cases if store.get(case) is None]
            if waiting:
                for programme in dict.fromkeys(SUBSETS[name][0] for name in subsets):
                    lab.library(cases[0], programme, progress)
            with Workers(said_each, (lab, subsets), processes) as workers:
                for found in finish(workers, cases, store, progress, f"diagnosing cases of leg {leg + 1}", _line):
                    every += found
            document = {"cases": json_types([one.__dict__ for one in every])}
            write_results(folder, document, page(every))


def _line(case: SealedCase, found: list[Said]) -> str:
    if not found:
        return f"{case.name}: LEFT OUT, a solution stopped"
    said = "; ".join(f"{one.subset}: {cell_of(one)} ({one.seconds:.1f} s)" for one in found)
    return f"{case.name} {found[0].concealed}, C10 {found[0].true_c10:.2f}: {said}"


if __name__ == "__main__":
    app(prog_name="python -m studies.sealed")

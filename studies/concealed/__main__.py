"""``python -m studies.concealed``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from legfem.common.command_line import study_context
from legfem.common.documents import write_atomically, write_document
from legfem.common.errors import InputError
from legfem.common.progress import Progress, progress_on
from legfem.inverse.correction import read_correction
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.diagnosis import Diagnoser
from legfem.legs.finite_element_models import library_folder
from legfem.report.style import save
from studies.command_line import DONE_IS_KEPT, Jobs, Library, Out, new_app
from studies.concealed.cases import make_cases
from studies.concealed.diagnosing import run_cases
from studies.concealed.making import Maker, make
from studies.concealed.page import cases_page, figure, page, scored_document, summarise
from studies.concealed.scoring import score_cases


@dataclass(frozen=True)
class ConcealedOptions:
    """What is asked for; the steps that are, in this order."""

    out: Path
    library: Path
    make: int | None
    legs: int
    people: int
    run: bool
    score: bool
    seed: int
    jobs: int


def prove(options: ConcealedOptions, progress: Progress) -> list[str]:
    """Make, diagnose and score sealed cases; return lines for the terminal."""
    correction = read_correction(REFERENCE)
    lines = []
    if options.make is not None:
        (options.out / "cases").mkdir(parents=True, exist_ok=True)
        maker = Maker(options.out, options.library / "truth", options.seed, correction)
        cases = make_cases(options.make, options.seed, options.legs, options.people)
        make(cases, maker, options.jobs, progress)
        lines.append(f"cases: {options.out / 'cases'}; keys, sealed: {options.out / 'keys'}")
    diagnoser = Diagnoser(options.library, correction, options.jobs)
    if options.run:
        run_cases(options.out, diagnoser, options.jobs, progress)
        lines.append(f"diagnoses: {options.out / 'diagnoses'}")
    if options.score:
        scored = score_cases(options.out, options.seed, diagnoser)
        summary = summarise(scored)
        path = write_document(options.out / "result.json", scored_document(scored, summary))
        text = page(scored, summary)
        write_atomically(options.out / "report.md", text)
        write_atomically(options.out / "cases.md", cases_page(scored))
        save(figure(scored, summary), options.out, "sealed")
        lines += [text, f"result: {path}"]
    return lines


app = new_app()


@app.command()
def concealed(
    make: Annotated[int | None, typer.Option(min=1, help="Make so many sealed cases (simulated).")] = None,
    run: Annotated[bool, typer.Option("--run", help="Diagnose the cases, blind.")] = False,
    score: Annotated[bool, typer.Option("--score", help="Open the keys and score.")] = False,
    legs: Annotated[int, typer.Option(min=1, help="True legs, each stated wrongly in its own way.")] = 6,
    people: Annotated[int, typer.Option(min=1, help="Stiffnesses of the muscle behind each leg.")] = 3,
    seed: Annotated[int, typer.Option(min=0, help="Of the cases; opens the keys.")] = 1,
    library: Library = None,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Prove the diagnosis on sealed cases: make them, diagnose them blind, open the keys.

    Cases, diagnoses and solutions are kept as they are done: the same command goes on where it was
    stopped.

    Example: python -m studies.concealed --make 150 --run --score --seed 1
    """
    with study_context("concealed", out, jobs, DONE_IS_KEPT) as (folder, processes):
        if make is None and not run and not score:
            raise InputError("concealed", "step", "none is given", "give --make N, --run or --score")
        options = ConcealedOptions(folder, library or library_folder(), make, legs, people, run, score, seed, processes)
        with progress_on() as progress:
            lines = prove(options, progress)
        for line in lines:
            typer.echo(line)


if __name__ == "__main__":
    app(prog_name="python -m studies.concealed")

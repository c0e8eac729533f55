"""What ``python -m studies.concealed`` does and writes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from legfem.common.documents import write_atomically, write_document
from legfem.common.progress import Progress
from legfem.legs.correction import read_correction
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.diagnosis import Diagnoser
from legfem.report.style import save
from studies.concealed.cases import make_cases
from studies.concealed.making import Maker, make
from studies.concealed.page import cases_page, figure, page, scored_document
from studies.concealed.running import run_cases
from studies.concealed.scoring import score_cases
from studies.concealed.summary import summarise


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


def run(options: ConcealedOptions, progress: Progress) -> list[str]:
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

"""What ``python -m legfem.study concealed`` does and writes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from legfem.correction import TabulatedCorrection, read_correction
from legfem.diagnose.leg import SHIPPED_CORRECTION
from legfem.diagnose.library import Library
from legfem.diagnose.predict import LawName
from legfem.diagnose.run import Diagnoser
from legfem.documents import write_atomically, write_document
from legfem.progress import Progress
from legfem.study.concealed.calibration import (
    Calibrated,
    Calibration,
    Emulated,
    null_p_values,
    smallest_effects,
)
from legfem.study.concealed.cases import Case, ProtocolName, make_cases
from legfem.study.concealed.making import Maker, build_libraries, make
from legfem.study.concealed.page import calibration_page, page, scored_document
from legfem.study.concealed.running import case_folders, run_cases
from legfem.study.concealed.scoring import score_cases, summarise
from legfem.subject import load_subject
from legfem.workers import Workers


@dataclass(frozen=True)
class ConcealedOptions:
    """What is asked for; the steps that are, in this order."""

    out: Path
    library: Path
    make: int | None
    run: bool
    score: bool
    calibrate: int | None
    seed: int
    jobs: int


def run(options: ConcealedOptions, progress: Progress) -> list[str]:
    """Make, diagnose and score sealed cases; return lines for the terminal."""
    correction = read_correction(SHIPPED_CORRECTION)
    diagnoser = Diagnoser(options.library, correction, options.jobs)
    lines = []
    if options.make is not None:
        cases = make_cases(options.make, options.seed)
        _make(cases, options, diagnoser, correction, progress)
        lines.append(f"cases: {options.out / 'cases'}; keys, sealed: {options.out / 'keys'}")
    if options.run:
        run_cases(options.out, diagnoser, options.jobs, progress)
        lines.append(f"diagnoses: {options.out / 'diagnoses'}")
    if options.score:
        scored = score_cases(options.out, options.seed, diagnoser)
        summary = summarise(scored)
        path = write_document(options.out / "result.json", scored_document(scored, summary))
        text = page(scored, summary)
        write_atomically(options.out / "report.md", text)
        lines += [text, f"result: {path}"]
    if options.calibrate is not None:
        calibration = calibrate(options, diagnoser, progress)
        path = write_document(options.out / "calibration.json", calibration.document())
        text = calibration_page(calibration)
        write_atomically(options.out / "calibration.md", text)
        lines += [text, f"result: {path}"]
    return lines


def calibrate(options: ConcealedOptions, diagnoser: Diagnoser, progress: Progress) -> Calibrated:
    """Return p-values without effect and smallest effects, on the cases' legs and protocols."""
    assert options.calibrate is not None
    libraries: dict[tuple[str, str], tuple[Library, LawName, ProtocolName]] = {}
    for folder in case_folders(options.out):
        subject = load_subject(folder)
        observed = diagnoser.observations(subject)
        protocol: ProtocolName = "rates" if len(observed.protocols) > 1 else "ramps"
        leg = (folder / "contours.csv").read_text(), protocol
        if leg not in libraries:
            library, _ = diagnoser.library(subject, observed, progress)
            libraries[leg] = (library, subject.tissues["deep"].law, protocol)
    kinds = list(libraries.values())
    tasks = [Emulated(*kinds[k % len(kinds)], options.seed + k) for k in range(options.calibrate)]
    progress.stage("recordings without effect", len(tasks))
    found = {}
    with Workers(_null, None, options.jobs) as workers:
        for task, p_values in workers.run(tasks):
            found[task.seed] = p_values
            progress.advance(f"p = {p_values[0]:.3f}")
    verdict, windows = np.array([found[task.seed] for task in tasks]).T
    smallest: dict[str, dict[str, list[float]]] = {}
    for library, law, protocol in kinds:
        for name, size in smallest_effects(Emulated(library, law, protocol, options.seed)).items():
            smallest.setdefault(name, {}).setdefault(protocol, []).append(size)
    return Calibrated(Calibration(verdict), Calibration(windows), smallest)


def _null(context: None, task: Emulated) -> tuple[float, float]:
    return null_p_values(task)


def _make(
    cases: Sequence[Case],
    options: ConcealedOptions,
    diagnoser: Diagnoser,
    correction: TabulatedCorrection,
    progress: Progress,
) -> None:
    (options.out / "cases").mkdir(parents=True, exist_ok=True)
    build_libraries(cases, diagnoser, progress)
    alone = Diagnoser(diagnoser.folder, correction, 1)
    maker = Maker(options.out, options.library / "truth", options.seed, correction, alone)
    make(cases, maker, options.jobs, progress)

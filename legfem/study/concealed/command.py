"""What ``python -m legfem.study concealed`` does and writes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path

import numpy as np

from legfem.correction import TabulatedCorrection, read_correction
from legfem.diagnose.library import Library
from legfem.diagnose.mechanisms import MECHANISMS
from legfem.diagnose.predict import LawName
from legfem.diagnose.run import Diagnoser
from legfem.documents import write_atomically, write_document
from legfem.identify.correction import REFERENCE
from legfem.progress import Progress
from legfem.report.style import save
from legfem.study.concealed.calibration import (
    Calibrated,
    Calibration,
    Emulated,
    null_p_values,
)
from legfem.study.concealed.cases import LAWS, Case, ProtocolName, make_cases
from legfem.study.concealed.kept import Kept
from legfem.study.concealed.making import Maker, leg_library, make
from legfem.study.concealed.page import calibration_page, cases_page, page, scored_document
from legfem.study.concealed.power import (
    RATIOS,
    PowerCurve,
    Trial,
    Tried,
    power_curve,
    try_effect,
)
from legfem.study.concealed.power_page import power_document, power_figure, power_page
from legfem.study.concealed.running import run_cases
from legfem.study.concealed.scoring import score_cases, summarise
from legfem.workers import Workers

PROTOCOLS: tuple[ProtocolName, ...] = ("rates", "ramps")


@dataclass(frozen=True)
class ConcealedOptions:
    """What is asked for; the steps that are, in this order."""

    out: Path
    library: Path
    make: int | None
    run: bool
    score: bool
    calibrate: int | None
    power: int | None
    power_protocols: Sequence[str]
    seed: int
    jobs: int


def run(options: ConcealedOptions, progress: Progress) -> list[str]:
    """Make, diagnose and score sealed cases; return lines for the terminal."""
    correction = read_correction(REFERENCE)
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
        write_atomically(options.out / "cases.md", cases_page(scored))
        lines += [text, f"result: {path}"]
    if options.calibrate is not None:
        kinds = _kinds(diagnoser, progress)
        calibration = calibrate(
            kinds, options.calibrate, options.seed, options.jobs, progress, options.out / "emulated"
        )
        path = write_document(options.out / "calibration.json", calibration.document())
        text = calibration_page(calibration)
        write_atomically(options.out / "calibration.md", text)
        lines += [text, f"result: {path}"]
    if options.power is not None:
        kinds = _kinds(diagnoser, progress, options.power_protocols)
        curves = count_power(
            kinds, options.power, options.seed, options.jobs, progress, options.out / "emulated"
        )
        path = write_document(options.out / "power.json", power_document(curves))
        text = power_page(curves)
        write_atomically(options.out / "power.md", text)
        save(power_figure(curves), options.out, "power")
        lines += [text, f"result: {path}"]
    return lines


type Kind = tuple[Library, LawName, ProtocolName]


def _kinds(
    diagnoser: Diagnoser, progress: Progress, protocols: Sequence[str] = PROTOCOLS
) -> list[Kind]:
    """Return the libraries of the study's legs and protocols."""
    return [
        (leg_library(name, protocol, diagnoser, progress), LAWS[name], protocol)
        for protocol in PROTOCOLS
        if protocol in protocols
        for name in LAWS
    ]


def calibrate(
    kinds: Sequence[Kind], number: int, seed: int, jobs: int, progress: Progress, folder: Path
) -> Calibrated:
    """Return p-values of emulated recordings without effect, on the cases' legs and protocols."""
    kept = Kept(folder, "calibration", [library for library, *_ in kinds])
    tasks = [Emulated(*kinds[k % len(kinds)], seed + k) for k in range(number)]
    left = [task for task in tasks if str(task.seed) not in kept]
    progress.stage("recordings without effect", len(left))
    with Workers(_null, None, jobs) as workers:
        for task, p_values in workers.run(left):
            kept.add(str(task.seed), p_values)
            progress.advance(f"p = {p_values[0]:.3f}")
    verdict, windows = np.array([kept[str(task.seed)] for task in tasks]).T
    return Calibrated(Calibration(verdict), Calibration(windows))


def _null(context: None, task: Emulated) -> tuple[float, float]:
    return null_p_values(task)


def count_power(
    kinds: Sequence[Kind], number: int, seed: int, jobs: int, progress: Progress, folder: Path
) -> list[PowerCurve]:
    """Return every mechanism's power from so many recordings a strength and protocol."""
    kept = Kept(folder, "power", [library for library, *_ in kinds])
    tasks = []
    for protocol in PROTOCOLS:
        mine = [kind for kind in kinds if kind[2] == protocol]
        for mechanism, ratio, k in product(MECHANISMS, RATIOS, range(number if mine else 0)):
            emulated = Emulated(*mine[k % len(mine)], seed + 1000 + k)
            tasks.append(Trial(emulated, mechanism.name, ratio))
    left = [task for task in tasks if task.name not in kept]
    progress.stage("recordings with an effect", len(left))
    with Workers(_tried, None, jobs) as workers:
        for task, tried in workers.run(left):
            kept.add(task.name, None if tried is None else asdict(tried))
            progress.advance(f"{task.mechanism} times {task.ratio:g}: {tried}")
    found: dict[tuple[ProtocolName, str], list[tuple[Trial, Tried]]] = {}
    for task in tasks:
        if kept[task.name] is not None:
            outcomes = found.setdefault((task.emulated.protocol, task.mechanism), [])
            outcomes.append((task, Tried(**kept[task.name])))
    return [
        power_curve(m.name, protocol, found[protocol, m.name])
        for m in MECHANISMS
        for protocol in PROTOCOLS
        if (protocol, m.name) in found
    ]


def _tried(context: None, task: Trial) -> Tried | None:
    return try_effect(task)


def _make(
    cases: Sequence[Case],
    options: ConcealedOptions,
    diagnoser: Diagnoser,
    correction: TabulatedCorrection,
    progress: Progress,
) -> None:
    (options.out / "cases").mkdir(parents=True, exist_ok=True)
    for name, protocol in sorted({(case.subject, case.protocol) for case in cases}):
        leg_library(name, protocol, diagnoser, progress)
    alone = Diagnoser(diagnoser.folder, correction, 1)
    maker = Maker(options.out, options.library / "truth", options.seed, correction, alone)
    make(cases, maker, options.jobs, progress)

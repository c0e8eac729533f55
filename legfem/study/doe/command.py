"""What ``python -m legfem.study doe`` does and writes."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from legfem.common.documents import write_atomically, write_document
from legfem.common.progress import progress_on
from legfem.data.folder import RESOURCES
from legfem.jobs.pool import Workers
from legfem.jobs.ranks import lead
from legfem.jobs.store import Store
from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from legfem.legs.subject import Subject
from legfem.report.folder import REPORT, RESULT, ReportFile
from legfem.report.page import PAGE
from legfem.report.render.text import table
from legfem.report.write import write_page
from legfem.study.doe.anova import Counting
from legfem.study.doe.definition import Definition, read_definition
from legfem.study.doe.document import study_document, verdict_documents
from legfem.study.doe.figures import draw_half_normal, draw_normality, draw_response
from legfem.study.doe.figures_beyond import draw_information, draw_sobol
from legfem.study.doe.page import claims_page, gather_figures
from legfem.study.doe.remarks import fascia_note, stopped_short
from legfem.study.doe.runs import Workshop, as_csv, simulate
from legfem.study.doe.simulator import PlaneStrainSimulator, Record, Request, Simulator
from legfem.study.doe.study import StudyResult, study
from legfem.study.doe.tables import anova_cells, table_3_cells
from legfem.study.doe.verdict import verdicts
from legfem.study.doe.web_page import study_web_page


@dataclass(frozen=True)
class DoeOptions:
    """What a user chose."""

    definitions: tuple[Path, ...]
    subject_id: str
    subject_dir: Path | None
    out: Path
    jobs: int
    seed: int
    counting: Counting
    beyond: bool
    quiet: bool = False


def run(options: DoeOptions, comm: Any, simulator: Simulator | None = None) -> bool:
    """Study every definition and write a folder each; under MPI only the first rank writes.

    Parameters
    ----------
    comm
        Over whose ranks the simulations are spread.
    simulator
        Of the subject's plane-strain test by default.

    Returns
    -------
    bool
        Whether any simulation reached its depth; true on other ranks.
    """
    solved = True

    def work() -> None:
        nonlocal solved
        definitions = [read_definition(path) for path in options.definitions]
        folder = options.subject_dir or SUBJECTS.find(options.subject_id)
        subject = load_subject(folder, need_recordings=False)
        given = simulator or PlaneStrainSimulator.of_subject(subject)
        with Workers(simulate, given, options.jobs, comm) as workers:
            solved = _write_all(options, definitions, subject, workers)

    lead(comm, work)
    return solved


def _write_all(
    options: DoeOptions,
    definitions: Sequence[Definition],
    subject: Subject,
    workers: Workers[Simulator, Request, Record],
) -> bool:
    # All studies share the simulations: the same point isn't done twice.
    store = Store(options.out / "runs", Record, workers.context.fingerprint())
    results, folders = [], []
    with progress_on(quiet=options.quiet) as progress:
        workshop = Workshop(workers, store, progress)
        for definition in definitions:
            out = options.out if len(definitions) == 1 else options.out / definition.source.stem
            results.append(_study(options, definition, subject, workshop, out))
            folders.append(out)
    for result in results:
        print(f"{result.definition.title}\n{table(*anova_cells(result))}")
        if beside := table_3_cells(result):
            print(f"beside the paper's Table 3\n{table(*beside)}")
    titles = [result.definition.title for result in results]
    found = verdicts(results)
    print("\n".join(f"{verdict.claim}: {verdict.verdict}" for verdict in found))
    if len(results) > 1:
        gather_figures(results, folders, options.out)
        page = claims_page(results, found, _command(options))
        write_atomically(options.out / "verdict.md", page)
        write_document(options.out / "result.json", {"schema": 1, "claims": verdict_documents(found, titles)})
        print(f"verdicts: {options.out / 'verdict.md'}")
    return any(len(result.failed) < len(result.records) for result in results)


def _command(options: DoeOptions) -> str:
    """Return the command that does the same study."""
    words = ["python -m legfem.study doe"]
    words += [f"--factors {_as_typed(path)}" for path in options.definitions]
    words.append(f"--subject-dir {options.subject_dir}" if options.subject_dir else f"--subject {options.subject_id}")
    words.append(f"--seed {options.seed}")
    words += ["--count factors"] if options.counting == "factors" else []
    words += [] if options.beyond else ["--factorial-only"]
    return " ".join(words)


def _as_typed(path: Path) -> str:
    return path.name if path.is_relative_to(RESOURCES) else str(path)


def _study(options: DoeOptions, definition: Definition, subject: Subject, workshop: Workshop, out: Path) -> StudyResult:
    began = time.perf_counter()

    def keep(table: pd.DataFrame) -> None:
        out.mkdir(parents=True, exist_ok=True)
        write_atomically(out / "runs.csv", as_csv(definition, table))

    result = study(definition, subject, workshop, options.counting, options.seed, options.beyond, keep)
    if note := fascia_note(result):
        print(note, file=sys.stderr)
    if short := stopped_short(result):
        print(f"warning: {short}", file=sys.stderr)
    files = [
        path
        for draw in (draw_response, draw_half_normal, draw_normality, draw_sobol, draw_information)
        for path in draw(result, out)
    ]
    page = study_web_page(result, options.seed, _command(options))
    entries = [
        *(ReportFile([path], "a figure") for path in files),
        ReportFile([Path("runs.csv"), Path("runs")], "every simulation: a table, and a file each"),
        RESULT,
    ]
    write_page(page, out, "curves and the response surface", entries)
    wall = time.perf_counter() - began
    write_document(out / "result.json", study_document(result, options.seed, wall))
    print(
        f"{definition.title}: {len(result.records)} runs, {result.seconds:.0f} s; "
        f"report: {out / REPORT}\npage:   {out / PAGE}"
    )
    return result

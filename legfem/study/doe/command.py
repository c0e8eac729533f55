"""``legfem study doe``: simulates every definition and writes a folder each, with the page on the paper's claims."""

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
from legfem.jobs.pool import Workers, leading
from legfem.jobs.store import Store
from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from legfem.legs.subject import Subject
from legfem.report.folder import REPORT, RESULT, ReportFile
from legfem.report.page import PAGE
from legfem.report.render import table, write_page
from legfem.study.doe import tables
from legfem.study.doe.claims import verdict_documents, verdicts
from legfem.study.doe.design import Definition, read_definition
from legfem.study.doe.figures import draw_half_normal, draw_information, draw_normality, draw_response, draw_sobol
from legfem.study.doe.page import claims_page, gather_figures, study_web_page
from legfem.study.doe.runs import Outlook, PlaneStrainSimulator, Record, Request, Simulator, Workshop, as_csv, simulate
from legfem.study.doe.study import StudyResult, simulations_of, study
from legfem.study.doe.surface import Counting
from legfem.study.doe.tables import study_document


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

    @property
    def command(self) -> str:
        """Command that does the same studies."""
        names = [path.name if path.is_relative_to(RESOURCES) else str(path) for path in self.definitions]
        words = ["legfem study doe", *(f"--factors {name}" for name in names)]
        words.append(f"--subject-dir {self.subject_dir}" if self.subject_dir else f"--subject {self.subject_id}")
        words.append(f"--seed {self.seed}")
        words += ["--count factors"] if self.counting == "factors" else []
        words += [] if self.beyond else ["--factorial-only"]
        return " ".join(words)


def run(options: DoeOptions, comm: Any, simulator: Simulator | None = None) -> bool:
    """Study every definition and write a folder each; under MPI only the first rank writes.

    Parameters
    ----------
    comm
        Communicator over whose ranks the simulations are spread.
    simulator
        What simulates; the subject's plane-strain test by default.

    Returns
    -------
    bool
        Whether any simulation reached its depth; true on other ranks.
    """
    with leading(comm) as first:
        if not first:
            return True
        definitions = [read_definition(path) for path in options.definitions]
        folder = options.subject_dir or SUBJECTS.find(options.subject_id)
        subject = load_subject(folder, need_recordings=False)
        given = simulator or PlaneStrainSimulator.of_subject(subject)
        with Workers(simulate, given, options.jobs, comm) as workers:
            return _write_all(options, definitions, subject, workers)


def _write_all(
    options: DoeOptions,
    definitions: Sequence[Definition],
    subject: Subject,
    workers: Workers[Simulator, Request, Record],
) -> bool:
    # All studies share the simulations: the same point isn't done twice.
    store = Store(options.out / "runs", Record, workers.context.fingerprint())
    alone = len(definitions) == 1
    folders = [options.out if alone else options.out / definition.source.stem for definition in definitions]
    with progress_on(quiet=options.quiet) as progress:
        planned = sum(simulations_of(definition, options.beyond) for definition in definitions)
        workshop = Workshop(workers, store, progress, Outlook(planned))
        results = [
            _study(options, definition, subject, workshop, out)
            for definition, out in zip(definitions, folders, strict=True)
        ]
    for result in results:
        print(f"{result.definition.title}\n{table(*tables.anova_cells(result))}")
        if beside := tables.table_3_cells(result):
            print(f"beside the paper's Table 3\n{table(*beside)}")
    found = verdicts(results)
    print("\n".join(f"{verdict.claim}: {verdict.verdict}" for verdict in found))
    if not alone:
        gather_figures(results, folders, options.out)
        write_atomically(options.out / "verdict.md", claims_page(results, found, options.command))
        claims = verdict_documents(found, [result.definition.title for result in results])
        write_document(options.out / "result.json", {"schema": 1, "claims": claims})
        print(f"verdicts: {options.out / 'verdict.md'}")
    return any(len(result.failed) < len(result.records) for result in results)


def _study(options: DoeOptions, definition: Definition, subject: Subject, workshop: Workshop, out: Path) -> StudyResult:
    began = time.perf_counter()

    def keep(table: pd.DataFrame) -> None:
        out.mkdir(parents=True, exist_ok=True)
        write_atomically(out / "runs.csv", as_csv(definition, table))

    result = study(definition, subject, workshop, options.counting, options.seed, options.beyond, keep)
    if note := result.fascia_note():
        print(note, file=sys.stderr)
    if short := result.stopped_short():
        print(f"warning: {short}", file=sys.stderr)
    drawers = draw_response, draw_half_normal, draw_normality, draw_sobol, draw_information
    page = study_web_page(result, options.seed, options.command)
    entries = [
        *(ReportFile([path], "a figure") for draw in drawers for path in draw(result, out)),
        ReportFile([Path("runs.csv"), Path("runs")], "every simulation: a table, and a file each"),
        RESULT,
    ]
    write_page(page, out, "curves and the response surface", entries)
    claims = verdict_documents(verdicts([result]), [definition.title])
    wall = time.perf_counter() - began
    write_document(out / "result.json", study_document(result, options.seed, wall, claims))
    print(
        f"{definition.title}: {len(result.records)} runs, {result.seconds:.0f} s; "
        f"report: {out / REPORT}\npage:   {out / PAGE}"
    )
    return result

"""``python -m legfem.diagnose``."""

from __future__ import annotations

import sys
import time
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Annotated

import typer

from legfem.cli import (
    FAILED,
    check_out_folder,
    command_edge,
    leave_to_first_rank,
    process_count,
)
from legfem.errors import InputError
from legfem.progress import progress_on
from legfem.subject import SUBJECTS

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command()
def diagnose(
    subject: Annotated[
        str | None, typer.Option(help="Id of a subject that comes with legfem.")
    ] = None,
    subject_dir: Annotated[
        Path | None, typer.Option(help="Folder of a subject of your own, instead.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for results; results/diagnose-ID by default.")
    ] = None,
    library: Annotated[
        Path | None,
        typer.Option(
            help="Folder of the legs' responses, shared by all diagnoses; "
            "~/.cache/legfem/responses by default."
        ),
    ] = None,
    correction: Annotated[
        Path | None,
        typer.Option(help="3D correction behind end-effects; the shipped one by default."),
    ] = None,
    jobs: Annotated[int | None, typer.Option(help="Processes; all cores by default.")] = None,
    seed: Annotated[
        int, typer.Option(help="Of the draws behind p-values; 0 by default.", show_default=False)
    ] = 0,
) -> None:
    """Say where model and recordings differ, which physics was left out, and what adding it does.

    Reads a subject folder (subject.toml, contours.csv, recordings/*.csv, one trial a file with
    loading, holds and unloading at any rates); writes diagnosis.json, a report and figures. The
    first diagnosis of a leg solves its library of responses (some minutes); later ones use it.

    Example: python -m legfem.diagnose --subject 3 --out results/diagnose-3
    """
    with command_edge("run the same command again to go on; solutions that are done are kept"):
        ranks = leave_to_first_rank()
        processes = process_count(jobs, ranks)
        from legfem.correction import read_correction
        from legfem.diagnose.document import document
        from legfem.diagnose.leg import library_folder
        from legfem.diagnose.run import Diagnoser
        from legfem.documents import write_document
        from legfem.identify.correction import REFERENCE
        from legfem.report.diagnosis import write_diagnosis_report
        from legfem.subject import load_subject

        if seed < 0:
            raise InputError("--seed", f"{seed}", "is negative", "give 0 or more")
        found = load_subject(SUBJECTS.named(subject, subject_dir), need_instrument=False)
        ends = read_correction(correction or REFERENCE)
        folder = out or Path("results") / f"diagnose-{found.id}"
        check_out_folder(folder)
        responses = library or library_folder()
        check_out_folder(responses)
        diagnoser = Diagnoser(responses, ends, processes)
        started = time.perf_counter()
        try:
            with progress_on() as progress:
                diagnosis = diagnoser.diagnose(found, progress, seed)
        except BrokenProcessPool:
            print(
                "a solving process was ended from outside (out of memory?): run the same "
                "command again with --jobs 1; solutions that are done are kept",
                file=sys.stderr,
            )
            raise typer.Exit(FAILED) from None
        seconds = time.perf_counter() - started
        content = document(diagnosis, found, seed, seconds)
        path = write_document(folder / "diagnosis.json", content)
        report = write_diagnosis_report(diagnosis, found, folder)
        print(report.read_text())
        print(f"result: {path}\nreport: {report}")

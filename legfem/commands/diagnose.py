"""``python -m legfem.diagnose``."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from legfem.commands.options import Jobs, Site, SpecimenDir, Subject, SubjectDir, specimens_for
from legfem.common.command_line import AsJson, Quiet, check_out_folder, work_edge
from legfem.common.doubts import log_doubts
from legfem.common.errors import InputError
from legfem.common.progress import progress_on
from legfem.legs.schema import SUBJECTS

if TYPE_CHECKING:
    from legfem.specimens.folder import SpecimenFolder

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command()
def diagnose(
    subject: Subject = None,
    subject_dir: SubjectDir = None,
    site: Site = None,
    specimen_dir: SpecimenDir = None,
    specimen: Annotated[
        list[str] | None,
        typer.Option(
            help="Of several specimens the one to diagnose; may be given again. All by default.", show_default=False
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for results; results/diagnose-ID by default.")] = None,
    library: Annotated[
        Path | None,
        typer.Option(
            help="Folder of the legs' responses, shared by all diagnoses; ~/.cache/legfem/responses by default."
        ),
    ] = None,
    correction: Annotated[
        Path | None, typer.Option(help="3D correction behind end-effects; the one in legfem by default.")
    ] = None,
    jobs: Jobs = None,
    seed: Annotated[int, typer.Option(help="Of the draws behind p-values; 0 by default.", show_default=False)] = 0,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Say where model and recordings differ, which physics was left out, and what adding it does.

    Reads a subject folder (subject.toml, contours.csv, recordings/*.csv, one trial a file with
    loading, holds and unloading at any rates); writes diagnosis.json, a report and figures. The
    first diagnosis of a leg solves its library of responses (some minutes); later ones use it.
    Of a leg with several [[site]] each is diagnosed by itself, with --site.
    With --specimen-dir each specimen of a folder (specimen.toml, recordings/*.csv) is diagnosed.

    Example: python -m legfem.diagnose --subject 3 --out results/diagnose-3
    """
    resume = "run the same command again to go on; solutions that are done are kept"
    with work_edge(jobs, resume, quiet) as processes:
        if seed < 0:
            raise InputError("--seed", f"{seed}", "is negative", "give 0 or more")
        if specimen_dir is not None:
            legs_alone = {
                "--subject": subject,
                "--subject-dir": subject_dir,
                "--site": site,
                "--correction": correction,
            }
            found_specimens = specimens_for("diagnose", specimen_dir, out, legs_alone)
            _run_specimens(*found_specimens, specimen or (), library, processes, seed, quiet, as_json)
            return
        if specimen:
            raise InputError("--specimen", specimen[0], "is for specimens", "give --specimen-dir")
        from legfem.commands.options import print_outcome
        from legfem.common.documents import write_document
        from legfem.legs.correction import read_correction
        from legfem.legs.correction_of_leg import REFERENCE
        from legfem.legs.diagnosis import Diagnoser
        from legfem.legs.loading import load_subject
        from legfem.legs.plan import plan_after
        from legfem.legs.plausibility import doubts_about
        from legfem.legs.variants import library_folder
        from legfem.report.diagnosis import write_diagnosis_report
        from legfem.report.diagnosis_document import document
        from legfem.report.plan import plan_document, plan_lines
        from legfem.report.web.page import command_line

        folder = SUBJECTS.named(subject, subject_dir)
        found = load_subject(folder, need_instrument=False, site=site or "")
        log_doubts(doubts_about(found))
        ends = read_correction(correction or REFERENCE)
        folder = out or Path("results") / f"diagnose-{found.id}"
        check_out_folder(folder)
        responses = library or library_folder()
        check_out_folder(responses)
        diagnoser = Diagnoser(responses, ends, processes)
        started = time.perf_counter()
        with progress_on(quiet=quiet) as progress:
            diagnosis = diagnoser.diagnose(found, progress, seed)
            ranked = plan_after(diagnosis, found, diagnoser, progress)
        seconds = time.perf_counter() - started
        content = document(diagnosis, found, seed, seconds)
        if ranked:
            content["next_experiment_ranked"] = plan_document(ranked, found.id)["tests"]
        path = write_document(folder / "diagnosis.json", content)
        report = write_diagnosis_report(diagnosis, found, folder, plan_lines(ranked), command_line())
        print_outcome([report.read_text(encoding="utf-8")], path, report, quiet, as_json)


def _run_specimens(
    found: SpecimenFolder,
    folder: Path,
    names: Sequence[str],
    library: Path | None,
    jobs: int,
    seed: int,
    quiet: bool,
    as_json: bool,
) -> None:
    from legfem.commands.options import print_outcome
    from legfem.legs.variants import library_folder
    from legfem.report.specimen_diagnosis import write_specimen_diagnoses
    from legfem.report.web.page import command_line
    from legfem.specimens.diagnosis import diagnose_specimens

    responses = library or library_folder()
    check_out_folder(responses)
    with progress_on(quiet=quiet) as progress:
        every = diagnose_specimens(found, names, responses, jobs, progress, seed)
        path, report = write_specimen_diagnoses(every, found, folder, seed, command_line())
    print_outcome([report.read_text(encoding="utf-8")], path, report, quiet, as_json)

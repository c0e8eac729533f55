"""``python -m legfem.plan``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from legfem.commands.options import Jobs, Site, Subject, SubjectDir
from legfem.common.command_line import AsJson, Quiet, check_out_folder, parallel_context
from legfem.common.doubts import log_doubts
from legfem.common.errors import check_finite
from legfem.common.progress import progress_on
from legfem.legs.schema import SUBJECTS

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command()
def plan(
    subject: Subject = None,
    subject_dir: SubjectDir = None,
    site: Site = None,
    c10: Annotated[float, typer.Option(min=0.05, max=50.0, help="Expected C10 (kPa).")] = 0.8,
    c20: Annotated[float, typer.Option(min=0.0, max=50.0, help="Expected C20 (kPa).")] = 0.0,
    depth: Annotated[float, typer.Option(min=5.0, max=60.0, help="To press to (mm).")] = 20.0,
    rate: Annotated[float, typer.Option(min=0.01, max=50.0, help="mm/s.")] = 0.5,
    out: Annotated[Path | None, typer.Option(help="Folder for results; results/plan-ID by default.")] = None,
    library: Annotated[Path | None, typer.Option(help="Folder of the legs' responses, shared with diagnoses.")] = None,
    jobs: Jobs = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Say before any test which tests of a leg would show which effects, and how probably.

    Reads a subject folder (subject.toml and contours.csv; recordings aren't needed); writes
    plan.json, report.html and report.txt. The leg's responses to all tests are solved once, in
    some minutes.

    Example: python -m legfem.plan --subject 3 --c10 0.7 --c20 0.8 --depth 20 --rate 0.4
    """
    resume = "run the same command again to go on; solutions that are done are kept"
    with parallel_context(jobs, resume, quiet) as processes:
        from legfem.commands.options import print_outcome
        from legfem.common.documents import write_document
        from legfem.legs.correction import read_correction
        from legfem.legs.correction_of_leg import REFERENCE
        from legfem.legs.diagnosis import Diagnoser
        from legfem.legs.loading import load_subject
        from legfem.legs.plan import Expected, plan_before
        from legfem.legs.plausibility import doubts_about
        from legfem.legs.variants import library_folder
        from legfem.report.diagnosis_document import versions
        from legfem.report.folder import NUMBERS, REPORT, ReportFile, made_in_place
        from legfem.report.page import command_line
        from legfem.report.plan import RANKED, SHOWN, plan_document, plan_web_page
        from legfem.report.render.text import brief
        from legfem.report.write import write_page

        check_finite(c10=c10, c20=c20, depth=depth, rate=rate)
        found = load_subject(
            SUBJECTS.named(subject, subject_dir), need_recordings=False, need_instrument=False, site=site or ""
        )
        doubts = doubts_about(found)
        log_doubts(doubts)
        folder = out or Path("results") / f"plan-{found.id}"
        check_out_folder(folder)
        responses = library or library_folder()
        check_out_folder(responses)
        diagnoser = Diagnoser(responses, read_correction(REFERENCE), processes)
        with progress_on(quiet=quiet) as progress:
            expected = Expected(c10, c20, depth, rate)
            ranked = plan_before(found, diagnoser, expected, progress)
        path = write_document(folder / "plan.json", plan_document(ranked, found.id))
        page = plan_web_page(ranked, found, expected, doubts, versions(), command_line())
        with made_in_place(folder) as hidden:
            write_page(page, hidden, "what each test would show", [ReportFile([path], NUMBERS)])
        print_outcome([brief(page, (RANKED, SHOWN))], path, folder / REPORT, quiet, as_json)

"""``legfem plan``."""

from pathlib import Path

import typer

from legfem.commands.options import Jobs, Site, Subject, SubjectDir, finish
from legfem.common.command_line import AsJson, CheckedCommand, Quiet, parallel_context, results_folder
from legfem.legs.schema import SUBJECTS

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command(cls=CheckedCommand)
def plan(
    subject: Subject = None,
    subject_dir: SubjectDir = None,
    site: Site = None,
    c10: float = 0.8,
    c20: float = 0.0,
    depth: float = 20.0,
    rate: float = 0.5,
    out: Path | None = None,
    library: Path | None = None,
    jobs: Jobs = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Say before any test which tests of a leg would show which effects, and how probably.

    Reads a subject folder (subject.toml and contours.csv; recordings aren't needed); writes
    plan.json, report.html and report.txt. The leg's responses to all tests are solved once, in
    some minutes.

    Example: legfem plan --subject 3 --c10 0.7 --c20 0.8 --depth 20 --rate 0.4

    Parameters
    ----------
    c10
        Expected C10 (kPa), 0.05 to 50.
    c20
        Expected C20 (kPa), 0 to 50.
    depth
        Depth to press to (mm), from 5.
    rate
        Speed of pressing (mm/s), 0.01 to 50.
    out
        Folder for results; results/plan-ID by default.
    library
        Folder of the legs' responses, which diagnoses use too.
    """
    resume = "run the same command again to go on; solutions that are done are kept"
    with parallel_context(jobs, resume, quiet) as processes:
        from legfem.api.diagnosis import PLAN
        from legfem.api.diagnosis import plan as plan_in_full
        from legfem.legs.loading import load_subject

        directory = SUBJECTS.named(subject, subject_dir)
        leg = load_subject(directory, need_recordings=False, need_instrument=False, site=site or "")
        with results_folder(out, f"plan-{leg.id}") as folder:
            found = plan_in_full(
                leg, c10=c10, c20=c20, depth=depth, rate=rate, library=library, jobs=processes, progress=not quiet
            )
            finish(found, folder, PLAN, quiet, as_json, found.summary())

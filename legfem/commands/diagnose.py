"""``legfem diagnose``."""

from pathlib import Path
from typing import Annotated

import typer

from legfem.commands.options import Jobs, Site, SpecimenDir, Subject, SubjectDir, finish, passed
from legfem.common.command_line import AsJson, CheckedCommand, Quiet, parallel_context, results_folder

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command(cls=CheckedCommand)
def diagnose(
    context: typer.Context,
    subject: Subject = None,
    subject_dir: SubjectDir = None,
    site: Site = None,
    specimen_dir: SpecimenDir = None,
    specimens: Annotated[list[str] | None, typer.Option("--specimen")] = None,
    out: Path | None = None,
    library: Path | None = None,
    correction: Path | None = None,
    prior: list[str] | None = None,
    within: Annotated[str | None, typer.Option("--for", "--within")] = None,
    jobs: Jobs = None,
    seed: Annotated[int, typer.Option(show_default=False)] = 0,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Say where model and recordings differ, which physics was left out, and what adding it does.

    Reads a subject folder (subject.toml, contours.csv, recordings/*.csv, one trial a file with
    loading, holds and unloading at any rates); writes diagnosis.json, a report and figures. The
    first diagnosis of a leg solves its library of responses (a minute or some); later ones use it.
    Of a leg with several [[site]] each is diagnosed by itself, with --site.
    With --specimen-dir each specimen of a folder (specimen.toml, recordings/*.csv) is diagnosed.

    Example: legfem diagnose --subject 3 --out results/diagnose-3

    Parameters
    ----------
    specimens
        Specimen to diagnose, if the folder has several; repeatable. All by default.
    out
        Folder for results; results/diagnose-ID by default.
    library
        Folder of the legs' responses, shared by all diagnoses; ~/.cache/legfem/responses by default.
    correction
        3D correction for the cylinder's ends; legfem's own by default.
    prior
        What is known of C10 of the muscle, as for identify: 'deep.C10=population.json' of a cohort.
    within
        Time after which nothing more is solved, such as 30s: a provisional answer. As long as it takes by default.
    seed
        Seed of the random draws behind p-values; 0 by default.
    """
    resume = "run the same command again to go on; solutions that are done are kept"
    with parallel_context(jobs, resume, quiet) as processes:
        from legfem.api.diagnosis import diagnose as diagnose_in_full
        from legfem.api.loading import check_folder, named
        from legfem.api.results import DIAGNOSIS

        check_folder("library", library)
        leg = named(subject, subject_dir, specimen_dir, site)
        with results_folder(out, f"diagnose-{leg.id}") as folder:
            found = diagnose_in_full(
                leg,
                **passed(context, "library", "correction", "seed", "specimens", "site", "prior", "within"),
                out=folder,
                jobs=processes,
                progress=not quiet,
            )
            finish(found, folder, DIAGNOSIS, quiet, as_json)

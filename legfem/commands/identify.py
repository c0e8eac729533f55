"""``legfem identify``."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Literal

import typer

from legfem.commands.options import Jobs, Site, SpecimenDir, Subject, SubjectDir, finish, passed
from legfem.common import command_line
from legfem.common.errors import InputError, UnsolvedError

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command(name="identify", cls=command_line.CheckedCommand)
def run(
    context: typer.Context,
    subject: Subject = None,
    subject_dir: SubjectDir = None,
    site: Site = None,
    specimen_dir: SpecimenDir = None,
    leave_out: list[str] | None = None,
    law: Literal["neo-hookean", "reduced-polynomial", "yeoh", "exponential", "both"] | None = None,
    identify: list[str] | None = None,
    prior: list[str] | None = None,
    fix: list[str] | None = None,
    out: Path | None = None,
    jobs: Jobs = None,
    seed: Annotated[int, typer.Option(show_default=False)] = 1,
    depth: float | None = None,
    correction: Annotated[str, typer.Option(show_default=False)] = "auto",
    model: Annotated[Literal["2d", "3d"], typer.Option(show_default=False)] = "2d",
    field: Annotated[bool, typer.Option("--field")] = False,
    weighting: Literal["paper", "covariance"] | None = None,
    c10_bounds: tuple[float, float] | None = None,
    c20_bounds: tuple[float, float] | None = None,
    quiet: command_line.Quiet = False,
    as_json: command_line.AsJson = False,
) -> None:
    """Identify the stiffness of a leg's tissues from indentation tests.

    Reads a subject folder (subject.toml, contours.csv, recordings/*.csv); writes result.json, a
    report and figures. Every full solve is kept: the same command goes on where it was stopped.
    Of a leg with several [[site]] all are fitted together, or with --site one.
    With --specimen-dir a tissue is identified from all recordings of a folder of specimens
    (specimen.toml, recordings/*.csv) together.

    Example: legfem identify --subject 3 --law both --out results/subject-3

    Parameters
    ----------
    leave_out
        Recording, specimen or test to predict instead of fitting it; repeatable.
    law
        Strain energy of the deep tissue; both by default, with --identify the neo-Hookean one unless deep.C20 is
        among the names or given; yeoh and exponential are for specimens.
    identify
        Full name of a parameter to identify, in place of the law's own: deep.C10, deep.C20, deep.D1,
        superficial.C10, fascia.C10, instrument.gain, ..., with --model 3d deep.fibre_ratio, of specimens LAYER.C10
        and deep.fibre_ratio; may be given again.
    prior
        What is known of a parameter before the test: 'superficial.C10=2±1 kPa' (+- may be written for ±), or
        'superficial.C10=2 x/ 1.5 kPa' for a factor, or 'superficial.C10=population' (also deep.C10) for that of
        people's calves; one that isn't to be identified may deviate by it; may be given again.
    fix
        Value to hold in place of the folder's: 'deep.D1=28 1/MPa'; may be given again.
    out
        Folder for results; results/identify-ID by default.
    seed
        Seed of the genetic algorithm; 1 by default.
    depth
        Use the recordings down to this depth only, mm.
    correction
        Of 3D effects: own (the leg's, from legfem's table), none, or a file; own by default, none for recordings
        simulated in plane strain.
    model
        2d (the default): a section in plane strain, corrected from a table; 3d: some full solves of the leg itself
        confirm the correction and take the table's place (tens of minutes). With several [[site]],
        deep.fibre_ratio, or what doesn't lie along the leg, the search goes on solves in 3D alone.
    field
        Map where the muscle is stiffer and where softer, and what the recordings tell of that: from displacements
        inside the section (a minute more, some more where forms are compiled first). Of one site, in 2d.
    weighting
        covariance (the default): loading, hold and unloading of every trial, weighted by their errors; paper: the
        plain sum of squares over the loading (Eq. 12).
    c10_bounds
        Bounds of the search for deep.C10 (kPa); 0.02 30 by default.
    c20_bounds
        Bounds of the search for deep.C20 (kPa); 0 50 by default.
    """
    with _edge(model, jobs, quiet) as processes:
        from mpi4py import MPI

        from legfem.api.identification import identify as identify_in_full
        from legfem.api.loading import named

        leg = named(subject, subject_dir, specimen_dir, site)
        with command_line.results_folder(out, f"identify-{leg.id}") as folder:
            found = identify_in_full(
                leg,
                **passed(context, "law", "identify", "prior", "fix", "c10_bounds", "c20_bounds", "correction", "depth"),
                **passed(context, "model", "field", "leave_out", "weighting", "seed"),
                site="" if specimen_dir is None else site or "",
                out=folder,
                jobs=processes,
                progress=not quiet,
                comm=MPI.COMM_WORLD if model == "3d" else None,
            )
            finish(found, folder, "result.json", quiet, as_json, found.summary())


@contextmanager
def _edge(model: str, jobs: int | None, quiet: bool) -> Iterator[int]:
    """As `legfem.common.command_line.parallel_context`; in 3D the other ranks join in the first one's solves."""
    resume = "run the same command again to go on; solves that are done are kept"
    if model == "2d":
        with command_line.parallel_context(jobs, resume, quiet) as processes:
            yield processes
        return
    import petsc4py.PETSc  # noqa: F401  (it starts on all ranks together)
    from mpi4py import MPI

    from legfem.jobs.pool import leading

    comm = MPI.COMM_WORLD
    with command_line.command_context(resume, quiet), leading(comm, (InputError, UnsolvedError, typer.Exit)) as first:
        if not first:
            raise typer.Exit(0)
        yield command_line.process_count(jobs, comm.size)

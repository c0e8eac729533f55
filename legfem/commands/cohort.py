"""``legfem cohort``."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from legfem.commands.options import Jobs, passed, print_outcome
from legfem.common import command_line

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command(cls=command_line.CheckedCommand)
def cohort(
    context: typer.Context,
    folder: Annotated[Path | None, typer.Argument(show_default=False)] = None,
    do: Annotated[Literal["identify", "diagnose", "stocking"], typer.Option(show_default=False)] = "identify",
    layout: Annotated[str, typer.Option(show_default=False)] = "",
    table: Path | None = None,
    law: str | None = None,
    identify: list[str] | None = None,
    prior: list[str] | None = None,
    fix: list[str] | None = None,
    depth: float | None = None,
    correction: str | None = None,
    model: Literal["2d", "3d"] | None = None,
    mesh: Literal["coarse"] | None = None,
    library: Path | None = None,
    cells: int | None = None,
    seed: int | None = None,
    out: Path | None = None,
    on: Annotated[Literal["local", "mpi", "dask"], typer.Option(show_default=False)] = "local",
    scheduler: str | None = None,
    jobs: Jobs = None,
    population: Annotated[bool, typer.Option("--population")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run")] = False,
    quiet: command_line.Quiet = False,
    as_json: command_line.AsJson = False,
) -> None:
    """Identify or diagnose every leg of a cohort, or compute its stocking, and compare all of them.

    Reads a folder of subject, specimen or stocking folders and, if it is there, cohort.csv or
    cohort.xlsx (subject, folder, group, side, session, date, rater, rig, age, sex, BMI, any columns);
    writes the table, a page, and each member's own report. A member that fails costs its own row.
    The same command goes on where it was stopped, and does again only what has changed.

    Example: legfem cohort study --law reduced-polynomial --out results/study

    Parameters
    ----------
    folder
        Folder with the members' folders and, if you have one, cohort.csv or .xlsx; or leave it out, and give --table.
    do
        What to do with each member; identify by default.
    layout
        Pattern of the members' folders, such as 'P*/leg-*'; by default every folder below that has a subject.toml
        or specimen.toml (for stockings, a leg.toml).
    table
        Table of the members, in place of FOLDER/cohort.csv. Without FOLDER, a plain table of readings (member,
        value, visit or rater or method, and error where known), whose agreement is computed.
    law
        Strain energy, as for identify; both by default.
    identify
        Parameter to identify, as for identify; repeatable.
    prior
        What is known of a parameter, as for identify; repeatable.
    fix
        Value to hold, as for identify; repeatable.
    depth
        Greatest depth to use (mm), as for identify.
    correction
        3D correction, as for identify or diagnose.
    model
        Model of the leg, as for identify.
    mesh
        A coarse mesh, for a quick look at all legs; do not rely on its results.
    library
        Folder of the legs' responses, as for diagnose.
    cells
        About how many tetrahedra, as for stocking.
    seed
        Seed, as for identify or diagnose.
    out
        Folder for results; results/cohort-NAME by default.
    on
        Where several members run at once: in processes here (the default), on ranks of mpirun, or on a dask
        scheduler's workers.
    scheduler
        Address of the dask scheduler, the file that it writes, or a TOML of a queue ([slurm]).
    population
        Also fit how people differ; writes population.json, for --prior.
    dry_run
        Say what would be done, for how long and with how much memory.
    """
    resume = "run the same command again to go on; members that are done are kept"
    alone = (
        command_line.command_context(resume, quiet)
        if on == "mpi"
        else command_line.parallel_context(jobs, resume, quiet)
    )
    with alone as processes:
        from mpi4py import MPI

        from legfem.api.cohorts import DOCUMENT, Cohort
        from legfem.api.cohorts import cohort as cohort_in_full
        from legfem.cohort.rows import CSV, ExpectedRun
        from legfem.report.cohort import PAGE

        ranks = MPI.COMM_WORLD if on == "mpi" else None
        with command_line.results_folder(out, f"cohort-{(folder or table or Path()).resolve().name}", ranks) as place:
            found = cohort_in_full(
                folder,
                **passed(context, "cells", "layout", "table", "law", "identify", "prior", "fix", "depth", "correction"),
                **passed(context, "model", "mesh", "library", "do", "seed", "on", "scheduler", "population", "dry_run"),
                out=place,
                jobs=processes or 1,
                progress=not quiet,
            )
            if isinstance(found, ExpectedRun):
                print(found.summary(), end="")
                return
            report = found.write(place)
            print_outcome(found.summary(), place / DOCUMENT, report, quiet, as_json)
            if not as_json:
                print(f"page:   {report.with_name(PAGE)}")
                print(f"table:  {report.with_name(CSV)}\n" * isinstance(found, Cohort), end="")
            if isinstance(found, Cohort) and not any(row.done for row in found.rows):
                command_line.end_without_a_solution("no member could be done")

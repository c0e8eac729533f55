"""``python -m studies.frauziols``."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from mpi4py import MPI

from legfem.common.command_line import CheckedCommand, command_context, results_folder, study_context, usable_cores
from legfem.common.documents import write_atomically, write_document
from legfem.legs.schema import SUBJECTS
from legfem.study.correction import command as correction_command
from legfem.study.correction.calibration import Calibration
from legfem.study.doe.command import DoeOptions, run
from legfem.study.doe.design import IDENTIFIED, PAPER
from studies.command_line import DONE_IS_KEPT, Jobs, Out, Seed, new_app
from studies.frauziols import convergence as convergence_study
from studies.frauziols.claims import claims_page, gather_figures, verdicts
from studies.frauziols.correction_figure import draw_correction

app = new_app()


@app.callback(no_args_is_help=True)
def frauziols() -> None:
    """What the paper claims, and how far the model's own curve can be trusted.

    Example: python -m studies.frauziols claims
    """


@app.command()
def claims(seed: Seed = 1, subject: str = "3", out: Out = None, jobs: Jobs = None) -> None:
    """Put the claims of the paper's design of experiments to both designs; under mpirun over the ranks.

    Example: python -m studies.frauziols claims
    """
    with command_context(DONE_IS_KEPT), results_folder(out, "doe", MPI.COMM_WORLD) as folder:
        leg = SUBJECTS.find(subject)
        options = DoeOptions((PAPER, IDENTIFIED), leg, folder, jobs or usable_cores(), seed, beyond=True)
        results = run(options, MPI.COMM_WORLD)
        if results:
            found = verdicts(results)
            gather_figures(results, options)
            titles = [result.definition.title for result in results]
            write_atomically(folder / "verdict.md", claims_page(results, found, f"{_COMMAND} claims --seed {seed}"))
            write_document(folder / "claims.json", {"schema": 1, "studies": titles, "claims": list(map(asdict, found))})
            typer.echo("\n".join(f"{one.claim}: {one.verdict}" for one in found))
            typer.echo(f"verdicts: {folder / 'verdict.md'}")


@app.command()
def correction(out: Out = None, jobs: Jobs = None) -> None:
    """Draw the paper's Fig. 4: the correction P(d) of the idealised leg, as legfem study correction calibrates it.

    Example: python -m studies.frauziols correction
    """
    with study_context("correction", out, jobs, DONE_IS_KEPT) as (folder, processes):
        given = Calibration()
        found, lengths = correction_command.run(given, folder, processes)
        typer.echo(f"figure: {draw_correction(given.reference, found, lengths, folder)[0]}")


@app.command(cls=CheckedCommand)
def convergence(
    subject: Annotated[str, typer.Option(help="Id of one of legfem's own subjects.")] = "3",
    subject_dir: Annotated[Path | None, typer.Option(help="Folder of your own subject, in place of --subject.")] = None,
    c10_kpa: Annotated[float, typer.Option("--c10", min=0.0, help="Deep C10 (kPa).")] = 0.70,
    c20_kpa: Annotated[float, typer.Option("--c20", min=0.0, help="Deep C20 (kPa).")] = 0.80,
    depth: Annotated[float, typer.Option(min=1.0, max=60.0, help="Depth to press to (mm).")] = 30.0,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """How far the default settings are from convergence: mesh, steps and contact.

    Example: python -m studies.frauziols convergence --subject 3
    """
    with study_context("convergence", out, jobs) as (folder, processes):
        convergence_study.run(subject, subject_dir, (c10_kpa, c20_kpa), depth, folder, processes)


_COMMAND = "python -m studies.frauziols"


if __name__ == "__main__":
    app(prog_name=_COMMAND)

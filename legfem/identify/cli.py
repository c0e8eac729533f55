"""``python -m legfem.identify``."""

from __future__ import annotations

import sys
from concurrent.futures.process import BrokenProcessPool
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from legfem.cli import (
    FAILED,
    check_out_folder,
    command_edge,
    leave_to_first_rank,
    usable_cores,
)
from legfem.errors import InputError
from legfem.progress import progress_on

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


class LawChoice(StrEnum):
    """Which law to identify."""

    NEO_HOOKEAN = "neo-hookean"
    REDUCED_POLYNOMIAL = "reduced-polynomial"
    BOTH = "both"


class WeightingChoice(StrEnum):
    """What to minimise."""

    PAPER = "paper"
    COVARIANCE = "covariance"


@app.command()
def identify(
    subject: Annotated[
        str | None, typer.Option(help="Id of a subject that comes with legfem.")
    ] = None,
    subject_dir: Annotated[
        Path | None, typer.Option(help="Folder of a subject of your own, instead.")
    ] = None,
    law: Annotated[LawChoice, typer.Option(help="Strain energy of the deep tissue.")] = (
        LawChoice.BOTH
    ),
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for results; results/identify-ID by default."),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Processes; all cores by default.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the genetic algorithm.")] = 1,
    depth: Annotated[
        float | None, typer.Option(help="Use the recordings down to this depth only, mm.")
    ] = None,
    correction: Annotated[
        str, typer.Option(help="Of 3D effects: none, or a file with one.")
    ] = "none",
    weighting: Annotated[
        WeightingChoice,
        typer.Option(help="Plain sum of squares (Eq. 12), or weighted with the covariance."),
    ] = WeightingChoice.PAPER,
    c10_bounds: Annotated[tuple[float, float], typer.Option(help="Of the search, kPa.")] = (
        0.02,
        30.0,
    ),
    c20_bounds: Annotated[tuple[float, float], typer.Option(help="Of the search, kPa.")] = (
        0.0,
        50.0,
    ),
    emulator: Annotated[
        bool,
        typer.Option(help="Search on an emulator, or call the full model each time (slow)."),
    ] = True,
) -> None:
    """Identify the stiffness of the deep tissue from indentation tests.

    Reads a subject folder (subject.toml, contours.csv, recordings/*.csv); writes result.json, a
    report and figures. Every full solve is kept: the same command goes on where it was stopped.

    Example: python -m legfem.identify --subject 3 --law both --out results/subject-3
    """
    with command_edge("run the same command again to go on; solves that are done are kept"):
        ranks = leave_to_first_rank()
        from legfem.identify.correction import find_correction
        from legfem.identify.identification import LAWS
        from legfem.identify.run import identify_subject, write_results
        from legfem.identify.search import SearchError
        from legfem.identify.settings import Bounds, IdentificationSettings
        from legfem.report.identification import write_identification_report
        from legfem.report.text import fit_report
        from legfem.subject import load_subject

        found = load_subject(_folder(subject, subject_dir))
        settings = IdentificationSettings(
            Bounds(c10_bounds, c20_bounds), weighting.value, seed, emulator
        )
        folder = out or Path("results") / f"identify-{found.id}"
        check_out_folder(folder)
        chosen = [name for name in LAWS if law in (LawChoice.BOTH, name)]
        # A rank of mpirun can't start processes that would use MPI too.
        processes = 1 if ranks > 1 else jobs or usable_cores()
        try:
            with progress_on() as progress:
                results = identify_subject(
                    found, chosen, settings, find_correction(correction),
                    folder, processes, depth, progress,
                )  # fmt: skip
        except SearchError as failure:
            print(f"{found.id}: {failure}", file=sys.stderr)
            raise typer.Exit(FAILED) from None
        except BrokenProcessPool:
            print(
                "a solving process was ended from outside (out of memory?): run the same "
                "command again with --jobs 1; solves that are done are kept",
                file=sys.stderr,
            )
            raise typer.Exit(FAILED) from None
        path = write_results(results, folder, as_list=law is LawChoice.BOTH)
        report = write_identification_report(results, found, None, folder)
        for result in results:
            print(fit_report(result))
        print(f"result: {path}\nreport: {report}")


def _folder(subject: str | None, subject_dir: Path | None) -> Path:
    from legfem.subject import find_subject

    if subject is not None and subject_dir is not None:
        raise InputError("--subject", subject, "--subject-dir is given too", "give one of them")
    if subject_dir is not None:
        return subject_dir
    if subject is None:
        raise InputError(
            "--subject", "missing", "no subject is given", "give --subject ID or --subject-dir PATH"
        )
    return find_subject(subject)

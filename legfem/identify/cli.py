"""``python -m legfem.identify``."""

from __future__ import annotations

import sys
from concurrent.futures.process import BrokenProcessPool
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

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

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


def _option(text: str) -> Any:
    # typer escapes the brackets around defaults that it shows for rich even when it isn't used.
    return typer.Option(help=text, show_default=False)


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
    law: Annotated[
        LawChoice, _option("Strain energy of the deep tissue; both by default.")
    ] = LawChoice.BOTH,
    out: Annotated[
        Path | None, typer.Option(help="Folder for results; results/identify-ID by default.")
    ] = None,
    jobs: Annotated[int | None, typer.Option(help="Processes; all cores by default.")] = None,
    seed: Annotated[int, _option("Of the genetic algorithm; 1 by default.")] = 1,
    depth: Annotated[
        float | None, typer.Option(help="Use the recordings down to this depth only, mm.")
    ] = None,
    correction: Annotated[
        str,
        _option(
            "Of 3D effects: own (the leg's, from the shipped table), none, or a file; own by "
            "default, none for recordings simulated in plane strain."
        ),
    ] = "auto",
    weighting: Annotated[
        WeightingChoice,
        _option("Plain sum of squares (Eq. 12; the default), or weighted with the covariance."),
    ] = WeightingChoice.PAPER,
    c10_bounds: Annotated[
        tuple[float, float], _option("Of the search, kPa; 0.02 30 by default.")
    ] = (0.02, 30.0),
    c20_bounds: Annotated[tuple[float, float], _option("Of the search, kPa; 0 50 by default.")] = (
        0.0,
        50.0,
    ),
    emulator: Annotated[
        bool,
        _option("Search on an emulator (the default), or call the full model each time (slow)."),
    ] = True,
) -> None:
    """Identify the stiffness of the deep tissue from indentation tests.

    Reads a subject folder (subject.toml, contours.csv, recordings/*.csv); writes result.json, a
    report and figures. Every full solve is kept: the same command goes on where it was stopped.

    Example: python -m legfem.identify --subject 3 --law both --out results/subject-3
    """
    with command_edge("run the same command again to go on; solves that are done are kept"):
        ranks = leave_to_first_rank()
        processes = process_count(jobs, ranks)
        from legfem.identify.correction import choose_correction
        from legfem.identify.forward import PlaneStrainForward
        from legfem.identify.identification import LAWS, measured_curve
        from legfem.identify.run import identify_subject, write_results
        from legfem.identify.search import SearchError
        from legfem.identify.settings import Bounds, IdentificationSettings
        from legfem.report.identification import write_identification_report
        from legfem.report.text import fit_report
        from legfem.subject import SUBJECTS, load_subject

        found = load_subject(SUBJECTS.named(subject, subject_dir))
        if seed < 0:
            raise InputError("--seed", f"{seed}", "is negative", "give 0 or more")
        settings = IdentificationSettings(
            Bounds(c10_bounds, c20_bounds), weighting.value, seed, emulator
        )
        folder = out or Path("results") / f"identify-{found.id}"
        check_out_folder(folder)
        chosen = [name for name in LAWS if law in (LawChoice.BOTH, name)]
        end = float(measured_curve(found, depth).displacement[-1])
        model = PlaneStrainForward.of_subject(found, end)
        try:
            with progress_on() as progress:
                results = identify_subject(
                    found, chosen, settings, choose_correction(correction, found),
                    folder, processes, depth, progress, model,
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
        report = write_identification_report(results, found, model.experiment, folder)
        for result in results:
            print(fit_report(result))
        print(f"result: {path}\nreport: {report}")

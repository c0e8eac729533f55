"""``python -m legfem.identify``."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from legfem.commands.options import Jobs, Site, SpecimenDir, Subject, SubjectDir, specimens_for
from legfem.common.command_edge import FAILED, check_out_folder, work_edge
from legfem.common.doubts import say
from legfem.common.errors import InputError
from legfem.common.outcome_options import AsJson, Quiet
from legfem.common.progress import progress_on

if TYPE_CHECKING:
    from legfem.api.results import Identified
    from legfem.inverse.parse_parameters import Written
    from legfem.inverse.settings import IdentificationSettings
    from legfem.legs.subject import SitedLeg
    from legfem.specimens.folder import SpecimenFolder

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


def _option(text: str) -> Any:
    # typer escapes the brackets around defaults that it shows for rich even when it isn't used.
    return typer.Option(help=text, show_default=False)


class LawChoice(StrEnum):
    """Which law to identify."""

    NEO_HOOKEAN = "neo-hookean"
    REDUCED_POLYNOMIAL = "reduced-polynomial"
    YEOH = "yeoh"
    EXPONENTIAL = "exponential"
    BOTH = "both"


class ModelChoice(StrEnum):
    """Where the cylinder's ends come from."""

    SECTION = "2d"
    LEG = "3d"


class WeightingChoice(StrEnum):
    """What to minimise."""

    PAPER = "paper"
    COVARIANCE = "covariance"


@app.command(name="identify")
def run(
    subject: Subject = None,
    subject_dir: SubjectDir = None,
    site: Site = None,
    specimen_dir: SpecimenDir = None,
    leave_out: Annotated[
        list[str] | None, _option("Recording or specimen to predict and not to fit; may be given again.")
    ] = None,
    law: Annotated[
        LawChoice | None,
        _option(
            "Strain energy of the deep tissue; both by default, with --identify the neo-Hookean "
            "one unless deep.C20 is among the names or given; yeoh and exponential are for "
            "specimens."
        ),
    ] = None,
    identify: Annotated[
        list[str] | None,
        _option(
            "Full name of a parameter to identify, in place of the law's own: deep.C10, deep.C20, "
            "deep.D1, superficial.C10, fascia.C10, instrument.gain, ..., with --model 3d "
            "deep.fibre_ratio, of specimens LAYER.C10 and deep.fibre_ratio; may be given again."
        ),
    ] = None,
    prior: Annotated[
        list[str] | None,
        _option(
            "What is known of a parameter beforehand: 'superficial.C10=2±1 kPa' (+- does too), or "
            "'superficial.C10=2 x/ 1.5 kPa' for a factor, or 'superficial.C10=population' (also "
            "deep.C10) for that of people's calves; one that isn't to be identified is let err by "
            "it; may be given again."
        ),
    ] = None,
    fix: Annotated[
        list[str] | None, _option("Value to hold in place of the folder's: 'deep.D1=28 1/MPa'; may be given again.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for results; results/identify-ID by default.")] = None,
    jobs: Jobs = None,
    seed: Annotated[int, _option("Of the genetic algorithm; 1 by default.")] = 1,
    depth: Annotated[float | None, typer.Option(help="Use the recordings down to this depth only, mm.")] = None,
    correction: Annotated[
        str,
        _option(
            "Of 3D effects: own (the leg's, from legfem's table), none, or a file; own by "
            "default, none for recordings simulated in plane strain."
        ),
    ] = "auto",
    model: Annotated[
        ModelChoice,
        _option(
            "2d (the default): a section in plane strain, corrected from a table; 3d: some full "
            "solves of the leg itself confirm the correction and take the table's place (tens of "
            "minutes). With several [[site]], deep.fibre_ratio, or what doesn't lie along the leg, "
            "the search goes on solves in 3D alone."
        ),
    ] = ModelChoice.SECTION,
    weighting: Annotated[
        WeightingChoice | None,
        _option(
            "Plain sum of squares (Eq. 12; the default), or weighted with the covariance (the default with a prior)."
        ),
    ] = None,
    c10_bounds: Annotated[
        tuple[float, float] | None, _option("Of the search for deep.C10, kPa; 0.02 30 by default.")
    ] = None,
    c20_bounds: Annotated[
        tuple[float, float] | None, _option("Of the search for deep.C20, kPa; 0 50 by default.")
    ] = None,
    emulator: Annotated[
        bool, _option("Search on an emulator (the default), or call the full model each time (slow).")
    ] = True,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Identify the stiffness of a leg's tissues from indentation tests.

    Reads a subject folder (subject.toml, contours.csv, recordings/*.csv); writes result.json, a
    report and figures. Every full solve is kept: the same command goes on where it was stopped.
    Of a leg with several [[site]] all are fitted together, or with --site one.
    With --specimen-dir a tissue is identified from all recordings of a folder of specimens
    (specimen.toml, recordings/*.csv) together.

    Example: python -m legfem.identify --subject 3 --law both --out results/subject-3
    """
    resume = "run the same command again to go on; solves that are done are kept"
    with _edge(model, jobs, resume, quiet) as processes:
        if specimen_dir is not None:
            legs_alone = {
                "--subject": subject,
                "--subject-dir": subject_dir,
                "--site": site,
                "--depth": depth,
                "--weighting": weighting,
                "--correction": None if correction == "auto" else 1,
                "--no-emulator": None if emulator else 1,
                "--model": None if model is ModelChoice.SECTION else 1,
            }
            _run_specimens(
                *specimens_for("identify", specimen_dir, out, legs_alone),
                None if law is None else law.value,
                (identify or (), prior or (), fix or (), c10_bounds, c20_bounds),
                leave_out or (),
                processes,
                seed,
                quiet,
                as_json,
            )
            return
        if leave_out:
            raise InputError("--leave-out", leave_out[0], "is for specimens", "give --specimen-dir")
        from legfem.inverse.parse_parameters import Written
        from legfem.inverse.settings import IdentificationSettings

        if seed < 0:
            raise InputError("--seed", f"{seed}", "is negative", "give 0 or more")
        settings = IdentificationSettings(None if weighting is None else weighting.value, seed, emulator)
        _run_leg(
            _loaded(subject, subject_dir, site),
            None if law is None else law.value,
            Written(identify or (), prior or (), fix or (), c10_bounds, c20_bounds),
            correction,
            model is ModelChoice.LEG,
            settings,
            depth,
            out,
            processes,
            quiet,
            as_json,
        )


def _loaded(subject: str | None, subject_dir: Path | None, site: str | None) -> SitedLeg:
    from legfem.legs.identification import as_leg
    from legfem.legs.loading import load_sites, load_subject
    from legfem.legs.schema import SUBJECTS

    folder = SUBJECTS.named(subject, subject_dir)
    sites = load_sites(folder) if site is None else None
    return as_leg(sites or load_subject(folder, site=site or ""))


def _run_leg(
    leg: SitedLeg,
    law: str | None,
    written: Written,
    correction: str,
    in_3d: bool,
    settings: IdentificationSettings,
    depth: float | None,
    out: Path | None,
    jobs: int,
    quiet: bool,
    as_json: bool,
) -> None:
    from mpi4py import MPI

    from legfem.api.results import Identified
    from legfem.inverse.settings import SearchRequest
    from legfem.legs.identification import check_joint, identify_leg, nominal_of, searches_in_3d
    from legfem.legs.laws import laws_of
    from legfem.legs.model_3d import check_has_ends
    from legfem.legs.plausibility import doubts_about
    from legfem.legs.problem import section_forward, split_instrument

    several, only_in_3d = len(leg.sites) > 1, searches_in_3d(leg, written.names, in_3d)
    if only_in_3d or several:
        check_joint(leg, settings, correction, only_in_3d)
    for one in leg.sites:
        say(doubts_about(one))
    nominal = nominal_of(leg, only_in_3d)
    parameters, fixed = written.parameters(nominal), written.held(nominal)
    shared = split_instrument(parameters, fixed)[0] if only_in_3d or several else parameters
    chosen = written.laws(law, shared or (), leg.sites[0].tissues["deep"].C20, fixed)
    laws_of(leg.sites[0], chosen, nominal, shared, fixed)
    folder = out or Path("results") / f"identify-{leg.id}"
    check_out_folder(folder)
    request = SearchRequest(parameters, fixed, depth, settings, folder, jobs)
    forward = None if only_in_3d else section_forward(leg, request)
    if in_3d and not only_in_3d:
        check_has_ends(leg.sites[0])
    with _searching(leg.id), progress_on(quiet=quiet) as progress:
        means = replace(request, progress=progress)
        fits = identify_leg(leg, chosen, means, correction, in_3d, MPI.COMM_WORLD, forward=forward)
    experiment = forward.models[0].experiment if forward is not None and not several else None
    _finish(Identified(tuple(fits), experiment), folder, jobs, quiet, as_json)


@contextmanager
def _searching(name: str) -> Iterator[None]:
    """End the command where too few full solves come as far as what was measured."""
    from legfem.inverse.search import SearchError

    try:
        yield
    except SearchError as failure:
        print(f"{name}: {failure}", file=sys.stderr)
        raise typer.Exit(FAILED) from None


def _finish(found: Identified, folder: Path, jobs: int, quiet: bool, as_json: bool) -> None:
    """Write what was found, and print it."""
    from legfem.commands.options import print_outcome
    from legfem.report.web.page import command_line

    report = found.write(folder, command_line(), jobs)
    print_outcome([found.summary()], folder / "result.json", report, quiet, as_json)


def _edge(model: ModelChoice, jobs: int | None, resume: str, quiet: bool) -> AbstractContextManager[int]:
    if model is ModelChoice.SECTION:
        return work_edge(jobs, resume, quiet)
    from legfem.commands.spread import spread_edge

    return spread_edge(jobs, resume, quiet)


def _run_specimens(
    found: SpecimenFolder,
    folder: Path,
    law: str | None,
    written: tuple[Any, ...],
    leave_out: Sequence[str],
    jobs: int,
    seed: int,
    quiet: bool,
    as_json: bool,
) -> None:
    from legfem.api.results import Identified
    from legfem.inverse.parse_parameters import Written
    from legfem.inverse.settings import IdentificationSettings, SearchRequest
    from legfem.specimens.laws import asked_in_writing, laws_named
    from legfem.specimens.problem import fit_specimens

    asked = asked_in_writing(Written(*written), found.tissues)
    settings = IdentificationSettings(seed=seed)
    with _searching(found.id), progress_on(quiet=quiet) as progress:
        request = SearchRequest(settings=settings, out=folder, jobs=jobs, progress=progress)
        fits = fit_specimens(found, laws_named(law), asked, leave_out, request)
    _finish(Identified(tuple(fits)), folder, jobs, quiet, as_json)

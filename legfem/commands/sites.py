"""What ``identify`` does with a leg that was pressed at several sites."""

from __future__ import annotations

import sys
from pathlib import Path

import typer

from legfem.common.command_edge import FAILED, check_out_folder
from legfem.common.doubts import say
from legfem.common.errors import InputError
from legfem.common.progress import progress_on
from legfem.identify.written import Written
from legfem.subjects.subject import SitedLeg


def check_joint(emulator: bool, weighting: str | None, leg: SitedLeg) -> None:
    """Check that what is asked for can be had of all sites together, or of a leg in 3D.

    Raises
    ------
    InputError
        If it can't.
    """
    name = leg.sites[0].site
    one = "leave it out" + (f", or identify one of the sites: --site {name}" if name else "")
    what = f"{len(leg.sites)} sites" if name else "the leg in 3D"
    for option, given, why in (
        ("--no-emulator", not emulator, "is for one site in plane strain"),
        ("--weighting", weighting == "paper", "paper weighs no site's errors against another's"),
    ):
        if given:
            raise InputError(option, what, why, one)


def identify_leg(
    leg: SitedLeg,
    law: str | None,
    written: Written,
    correction: str,
    folder: Path,
    jobs: int,
    seed: int,
    depth: float | None,
    quiet: bool,
    as_json: bool,
    in_3d: bool = False,
) -> None:
    """Identify what all sites share, in plane strain or in 3D, write and print it."""
    from mpi4py import MPI

    from legfem.commands.outcome import print_outcome
    from legfem.correction.choice import choose_correction
    from legfem.experiments.tissues import tissues_of
    from legfem.identify.catalogue import DEEP_RATIO
    from legfem.identify.forward import values_of
    from legfem.identify.request import SearchRequest
    from legfem.identify.search import SearchError
    from legfem.identify.settings import IdentificationSettings
    from legfem.identify.spatial import check_has_ends, start_of_ratio
    from legfem.report.plain import brief
    from legfem.report.sites import write_sites_report
    from legfem.report.web.page import command_line
    from legfem.report.web.sites import sites_web_page
    from legfem.sites.identification import asked_of, identify_sites
    from legfem.sites.spatial import identify_in_3d
    from legfem.subjects.plausibility import doubts_about

    for site in leg.sites:
        say(doubts_about(site))
    first = leg.sites[0]
    nominal = values_of(tissues_of(first))
    if in_3d:
        if correction not in ("auto", "none"):
            raise InputError(
                "--correction", correction, "nothing is left to correct in 3D", "leave it out"
            )  # fmt: skip
        for site in leg.sites:
            check_has_ends(site)
        nominal[DEEP_RATIO] = start_of_ratio(first)
    parameters, fixed = written.parameters(nominal), written.held(nominal)
    asked = asked_of(parameters, fixed)
    chosen = written.laws(law, asked.parameters or (), first.tissues["deep"].C20, fixed)
    check_out_folder(folder)
    try:
        with progress_on(quiet=quiet) as progress:
            settings = IdentificationSettings(seed=seed)
            request = SearchRequest(parameters, fixed, depth, settings, folder, jobs, progress)
            if in_3d:
                results = identify_in_3d(leg, chosen, request, comm=MPI.COMM_WORLD)
            else:
                corrections = [choose_correction(correction, site) for site in leg.sites]
                results = identify_sites(leg, chosen, request, corrections)
    except SearchError as failure:
        print(f"{leg.id}: {failure}", file=sys.stderr)
        raise typer.Exit(FAILED) from None
    path, report = write_sites_report(results, folder, command_line())
    print_outcome([brief(sites_web_page(results))], path, report, quiet, as_json)

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


def check_joint(in_3d: bool, emulator: bool, weighting: str | None, leg: SitedLeg) -> None:
    """Check that what is asked for can be had of all sites together.

    Raises
    ------
    InputError
        If it can't.
    """
    one = f"leave it out, or identify one of the sites: --site {leg.sites[0].site}"
    for option, given, why in (
        ("--model", in_3d, "3d solves the leg about one site's cylinder"),
        ("--no-emulator", not emulator, "is for one site"),
        ("--weighting", weighting == "paper", "paper weighs no site's errors against another's"),
    ):
        if given:
            raise InputError(option, f"{len(leg.sites)} sites", why, one)


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
) -> None:
    """Identify what all sites share, write and print it."""
    from legfem.commands.outcome import print_outcome
    from legfem.correction.choice import choose_correction
    from legfem.experiments.tissues import tissues_of
    from legfem.identify.forward import values_of
    from legfem.identify.request import SearchRequest
    from legfem.identify.search import SearchError
    from legfem.identify.settings import IdentificationSettings
    from legfem.report.plain import brief
    from legfem.report.sites import write_sites_report
    from legfem.report.web.page import command_line
    from legfem.report.web.sites import sites_web_page
    from legfem.sites.identification import asked_of, identify_sites
    from legfem.subjects.plausibility import doubts_about

    for site in leg.sites:
        say(doubts_about(site))
    first = leg.sites[0]
    nominal = values_of(tissues_of(first))
    parameters, fixed = written.parameters(nominal), written.held(nominal)
    asked = asked_of(parameters, fixed)
    chosen = written.laws(law, asked.parameters or (), first.tissues["deep"].C20, fixed)
    corrections = [choose_correction(correction, site) for site in leg.sites]
    check_out_folder(folder)
    try:
        with progress_on(quiet=quiet) as progress:
            settings = IdentificationSettings(seed=seed)
            request = SearchRequest(parameters, fixed, depth, settings, folder, jobs, progress)
            results = identify_sites(leg, chosen, request, corrections)
    except SearchError as failure:
        print(f"{leg.id}: {failure}", file=sys.stderr)
        raise typer.Exit(FAILED) from None
    path, report = write_sites_report(results, folder, command_line())
    print_outcome([brief(sites_web_page(results))], path, report, quiet, as_json)

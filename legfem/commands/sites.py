"""What ``identify`` does with a leg that was pressed at several sites."""

from __future__ import annotations

import sys
from pathlib import Path

import typer

from legfem.common.command_edge import FAILED, check_out_folder
from legfem.common.doubts import say
from legfem.common.progress import progress_on
from legfem.inverse.parse_parameters import Written
from legfem.inverse.settings import IdentificationSettings
from legfem.legs.subject import SitedLeg


def run_joint(
    leg: SitedLeg,
    law: str | None,
    written: Written,
    correction: str,
    folder: Path,
    jobs: int,
    settings: IdentificationSettings,
    depth: float | None,
    quiet: bool,
    as_json: bool,
    in_3d: bool = False,
) -> None:
    """Identify what all sites share, in plane strain or in 3D, write and print it."""
    from mpi4py import MPI

    from legfem.commands.options import print_outcome
    from legfem.inverse.search import SearchError
    from legfem.inverse.settings import SearchRequest
    from legfem.legs.identification import check_joint, nominal_of
    from legfem.legs.plausibility import doubts_about
    from legfem.legs.problem import split_instrument
    from legfem.report.page import command_line
    from legfem.report.render.text import brief
    from legfem.report.sites import write_sites_report
    from legfem.report.web.sites import sites_web_page
    from legfem.sites.identification import identify_together

    check_joint(leg, settings, correction, in_3d)
    for site in leg.sites:
        say(doubts_about(site))
    nominal = nominal_of(leg, in_3d)
    parameters, fixed = written.parameters(nominal), written.held(nominal)
    shared, _ = split_instrument(parameters, fixed)
    given_c20 = leg.sites[0].tissues["deep"].C20
    chosen = written.laws(law, shared or (), given_c20, fixed)
    check_out_folder(folder)
    try:
        with progress_on(quiet=quiet) as progress:
            request = SearchRequest(parameters, fixed, depth, settings, folder, jobs, progress)
            results = identify_together(leg, chosen, request, correction, in_3d, MPI.COMM_WORLD)
    except SearchError as failure:
        print(f"{leg.id}: {failure}", file=sys.stderr)
        raise typer.Exit(FAILED) from None
    path, report = write_sites_report(results, folder, command_line())
    print_outcome([brief(sites_web_page(results))], path, report, quiet, as_json)

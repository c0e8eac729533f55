"""``python -m legfem.stocking``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from legfem.common.command_line import FAILED, AsJson, Quiet, check_out_folder, command_context
from legfem.common.doubts import log_doubts
from legfem.common.errors import InputError
from legfem.common.progress import Silent, progress_on

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command()
def stocking(
    subject: Annotated[str | None, typer.Option(help="Id of a leg that comes with legfem.")] = None,
    subject_dir: Annotated[Path | None, typer.Option(help="Folder of a leg of your own, instead.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for results; results/stocking-ID by default.")] = None,
    cells: Annotated[int, typer.Option(help="About how many tetrahedra.")] = 15_000,
    nelder_mead: Annotated[
        bool, typer.Option("--nelder-mead", help="Search as the paper does, too: some 50 equilibria.")
    ] = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Stiffness of fat and muscle, and pressures inside a leg in a compression stocking.

    Reads leg.toml and the scans it names: of the bare leg, and of the leg in its stocking; writes
    result.json, a report and figures. Without the second scan it takes the stiffness from leg.toml.
    Under mpirun one solution is spread over the ranks.

    Example: python -m legfem.stocking --subject 1 --out results/leg-1
    """
    with command_context("run the same command again to go on; equilibria are kept", quiet):
        if not 2_000 <= cells <= 5_000_000:
            raise InputError("--cells", f"{cells}", "is out of range", "give 2000 to 5000000")
        from mpi4py import MPI

        from legfem.commands.options import print_outcome
        from legfem.report.page import command_line
        from legfem.report.stocking import NUMBERS, write_stocking_report
        from legfem.stockings.loading import LEGS, load_leg
        from legfem.stockings.result import StockingSettings, run_leg

        leg = load_leg(LEGS.named(subject, subject_dir))
        results = out or Path("results") / f"stocking-{leg.id}"
        check_out_folder(results)
        comm = MPI.COMM_WORLD
        if comm.rank == 0:
            log_doubts(leg.doubts)
        settings = StockingSettings(cells=cells, nelder_mead=nelder_mead)
        kept = results / "equilibria"
        if comm.rank == 0:
            with progress_on(quiet=quiet) as progress:
                result = run_leg(leg, settings, progress, comm, folder=kept)
        else:
            result = run_leg(leg, settings, Silent(), comm, folder=kept)
        report = write_stocking_report(result, results, command_line())
        if comm.rank == 0:
            text = report.read_text(encoding="utf-8")
            print_outcome([text], results / NUMBERS, report, quiet, as_json)
        if not result.equilibrium.converged:
            if comm.rank == 0:
                print(f"{leg.id}: no equilibrium with the stocking was found", file=sys.stderr)
            raise typer.Exit(FAILED)

"""``legfem stocking``."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from legfem.commands.options import print_outcome
from legfem.common.command_line import FAILED, AsJson, CheckedCommand, Quiet, command_context, results_folder
from legfem.common.errors import log_doubts

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command(cls=CheckedCommand)
def stocking(
    subject: str | None = None,
    subject_dir: Path | None = None,
    out: Path | None = None,
    cells: Annotated[int, typer.Option(min=2_000, max=5_000_000)] = 15_000,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Stiffness of fat and muscle, and pressures inside a leg in a compression stocking.

    Reads leg.toml and the scans it names: of the bare leg, and of the leg in its stocking; writes
    result.json, a report and figures. Without the second scan it takes the stiffness from leg.toml.
    Of girths by tape, without a scan, it computes the pressures on the skin and the fabric for a class.
    Under mpirun one solution is spread over the ranks.

    Example: legfem stocking --subject 1 --out results/leg-1

    Parameters
    ----------
    subject
        Id of one of legfem's own legs.
    subject_dir
        Folder of your own leg, in place of --subject.
    out
        Folder for results; results/stocking-ID by default.
    cells
        About how many tetrahedra.
    """
    with command_context("run the same command again to go on; equilibria are kept", quiet):
        from mpi4py import MPI

        from legfem.api.stockings import stocking as stocking_in_full
        from legfem.common.progress import progress_on
        from legfem.stockings.details import StockingNotice
        from legfem.stockings.loading import LEGS, load_leg

        first = MPI.COMM_WORLD.rank == 0
        with progress_on(quiet=quiet or not first) as progress:
            leg = load_leg(LEGS.named(subject, subject_dir), progress, cells)
        with results_folder(out, f"stocking-{leg.id}", MPI.COMM_WORLD) as folder:
            if first:
                log_doubts(leg.doubts)
            found = stocking_in_full(leg, cells=cells, out=folder, progress=not quiet, comm=MPI.COMM_WORLD)
            report = found.write(folder)
            if first:
                print_outcome(report.read_text(encoding="utf-8"), folder / "result.json", report, quiet, as_json)
            if {StockingNotice.NOT_COMPUTED, StockingNotice.UNSETTLED} & {one.code for one in found.best.notices}:
                if first:
                    print(f"{leg.id}: no equilibrium with the stocking was found", file=sys.stderr)
                raise typer.Exit(FAILED)

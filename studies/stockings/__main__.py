"""Options of ``python -m studies.stockings``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from legfem.common.command_line import check_out_folder, command_context, leave_to_first_rank, usable_cores
from studies.command_line import Jobs, new_app

app = new_app()


@app.command()
def stockings(
    part: Annotated[
        Literal["make", "identify", "claims", "sizes"],
        typer.Argument(
            help="make: simulate six legs' scans; identify: find the planted stiffnesses; claims: "
            "the paper's two claims on legs of different shape; sizes: one state by size of mesh, "
            "under mpirun on its ranks."
        ),
    ],
    legs: Annotated[Path, typer.Option(help="Folder of the simulated scans: made there, read from there.")] = Path(
        "results/stockings/legs"
    ),
    out: Annotated[Path, typer.Option(help="Folder for results.")] = Path("results/stockings"),
    cells: Annotated[int, typer.Option(min=10_000, help="About how many tetrahedra.")] = 15_000,
    seed: Annotated[int, typer.Option(min=0, help="Of the scans' noise.")] = 1,
    jobs: Jobs = None,
) -> None:
    """Repeat the second paper on six simulated legs in compression stockings.

    Example: python -m studies.stockings make; python -m studies.stockings identify
    """
    if part != "sizes":
        leave_to_first_rank()
    with command_context():
        from studies.stockings import command

        check_out_folder(out)
        processes = jobs or usable_cores()
        if part == "make":
            check_out_folder(legs)
            command.make(legs, seed, processes)
        elif part == "identify":
            command.identify(legs, out, cells, processes)
        elif part == "claims":
            command.claims(out, cells, processes)
        else:
            command.sizes(cells)


if __name__ == "__main__":
    app(prog_name="python -m studies.stockings")

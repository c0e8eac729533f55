"""``python -m legfem.study recordings``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from legfem.cli import check_out_folder, command_edge, leave_to_first_rank, usable_cores
from legfem.study.options import Jobs, Out


def recordings(
    data: Annotated[Path, typer.Option(help="Folder with the two public sets of recordings.")],
    test: Annotated[
        list[str] | None, typer.Option(help="Indentation by its name; a chosen set by default.")
    ] = None,
    ball_radius: Annotated[
        float, typer.Option(min=0.1, help="Of the indenter, which the data don't state (mm).")
    ] = 5.0,
    layer_radius: Annotated[float, typer.Option(min=1.0, help="Of the specimens (mm).")] = 40.0,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Diagnose public recordings of beef and silicone: what the elastic model leaves out.

    Example: python -m legfem.study recordings --data ../shared/data
    """
    leave_to_first_rank()
    with command_edge():
        from legfem.study.recordings import command
        from legfem.study.recordings.indentation import Assumed

        folder = out or Path("results") / "recordings"
        check_out_folder(folder)
        assumed = Assumed(ball_radius, layer_radius)
        command.run(data, test or command.CHOSEN, assumed, folder, jobs or usable_cores())

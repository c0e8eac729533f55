"""``python -m legfem.study worked``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from legfem.cli import check_out_folder, command_edge, leave_to_first_rank, usable_cores
from legfem.study.options import Jobs, Library, Out


class WorkedExample(StrEnum):
    """What the base model leaves out."""

    STRAIN_STIFFENING = "strain-stiffening"
    END_EFFECTS = "end-effects"


def worked(
    example: Annotated[
        list[WorkedExample] | None, typer.Option(help="Only this one; both by default.")
    ] = None,
    library: Library = None,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Two worked diagnoses of what the first paper left out: strain stiffening and 3D ends.

    Recordings are simulated on another discretisation and diagnosed end to end. Solutions are kept
    as they are done: the same command goes on where it was stopped.

    Example: python -m legfem.study worked
    """
    leave_to_first_rank()
    with command_edge("run the same command again to go on; solutions that are done are kept"):
        from legfem.diagnose.leg import library_folder
        from legfem.study.worked import command

        folder = out or Path("results") / "worked"
        check_out_folder(folder)
        chosen = [entry.value for entry in example or WorkedExample]
        command.run(chosen, folder, library or library_folder(), jobs or usable_cores())

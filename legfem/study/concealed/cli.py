"""``python -m legfem.study concealed``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from legfem.cli import check_out_folder, command_edge, leave_to_first_rank, usable_cores
from legfem.progress import progress_on
from legfem.study.options import Jobs, Library, Out


class ProtocolChoice(StrEnum):
    """How a case is recorded."""

    RAMPS = "ramps"
    RATES = "rates"


def concealed(
    make: Annotated[
        int | None, typer.Option(min=1, help="Make so many sealed cases (simulated).")
    ] = None,
    run: Annotated[bool, typer.Option("--run", help="Diagnose the cases, blind.")] = False,
    score: Annotated[bool, typer.Option("--score", help="Open the keys and score.")] = False,
    calibrate: Annotated[
        int | None,
        typer.Option(min=10, help="Emulate so many recordings without effect: are p-values true?"),
    ] = None,
    power: Annotated[
        int | None,
        typer.Option(min=3, help="Emulate so many recordings of each mechanism at each strength."),
    ] = None,
    protocol: Annotated[
        ProtocolChoice | None,
        typer.Option(help="Only loadings alone, or two rates with holds, for --power."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the cases; opens the keys.")] = 1,
    library: Library = None,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Prove the diagnosis on sealed cases: make them, diagnose them blind, open the keys.

    Cases, diagnoses and solutions are kept as they are done: the same command goes on where it was
    stopped.

    Example: python -m legfem.study concealed --make 80 --run --score --seed 1
    """
    leave_to_first_rank()
    with command_edge("run the same command again to go on; what is done is kept"):
        from legfem.diagnose.leg import library_folder
        from legfem.errors import InputError
        from legfem.study.concealed import command

        if make is None and calibrate is None and power is None and not run and not score:
            raise InputError(
                "concealed", "step", "none is given",
                "give --make N, --run, --score, --calibrate N or --power N",
            )  # fmt: skip
        folder = out or Path("results") / "concealed"
        check_out_folder(folder)
        options = command.ConcealedOptions(
            folder, library or library_folder(), make, run, score, calibrate, power,
            (protocol.value,) if protocol else command.PROTOCOLS, seed,
            jobs or usable_cores(),
        )  # fmt: skip
        with progress_on() as progress:
            lines = command.run(options, progress)
        for line in lines:
            typer.echo(line)

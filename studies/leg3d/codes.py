"""``python -m studies.leg3d.codes``: the study's leg by felupe's hexahedra and by legfem's."""

from __future__ import annotations

import time
from typing import Annotated

import typer

from legfem.common.command_line import command_context
from legfem.common.documents import markdown_table
from legfem.solve.path import ForceCurve
from studies.command_line import new_app
from studies.leg3d.fascia import SHOWN, layer
from studies.leg3d.other_code import OtherLeg
from studies.leg3d.planted import Planted

app = new_app()


@app.command()
def codes(
    finer: Annotated[
        list[float] | None, typer.Option(min=0.1, help="Than felupe's default mesh; may be given again.")
    ] = None,
    hexahedra: Annotated[
        list[float] | None, typer.Option(min=0.1, help="Likewise of legfem's hexahedra, which are left out by default.")
    ] = None,
) -> None:
    """Press a small round leg by two codes. Simulated.

    Example: python -m studies.leg3d.codes --finer 0.6 --finer 1 --hexahedra 1
    """
    with command_context():
        factors, others = finer or [1.0], hexahedra or []
        rows = []
        for factor in factors:
            started = time.process_time()
            test = OtherLeg(Planted(), factor)
            found = test.solve(SHOWN[-1])
            curve = ForceCurve(found.displacement, found.force, {})
            rows.append(_row(f"felupe, {factor:g}", test.unknowns, started, curve))
        for factor in others:
            started = time.process_time()
            solved = layer(finer=factor).solve(depth=SHOWN[-1])
            unknowns = solved.report.unknowns
            rows.append(_row(f"legfem, {factor:g}", unknowns, started, solved.curve))
        header = ["code, finer by", "unknowns", "processor s", *(f"N at {d:g} mm" for d in SHOWN)]
        typer.echo(markdown_table(header, rows))


def _row(name: str, unknowns: int, started: float, curve: ForceCurve) -> list[str]:
    shown = (f"{curve(d):.4f}" if d <= curve.depth + 1e-9 else "" for d in SHOWN)
    return [name, f"{unknowns:,}", f"{time.process_time() - started:.0f}", *shown]


if __name__ == "__main__":
    app(prog_name="python -m studies.leg3d.codes")

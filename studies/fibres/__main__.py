"""``python -m studies.fibres``: P(d) of the idealised leg with fibres along it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from matplotlib.figure import Figure

from legfem.common.command_line import study_context
from legfem.common.documents import markdown_table, write_atomically
from legfem.common.progress import Progress, progress_on
from legfem.common.units import FloatArray
from legfem.inverse.correction import FIBRES_TABLE
from legfem.report.style import save
from legfem.study.correction.calibration import run_cases
from studies.command_line import DONE_IS_KEPT, Jobs, Out, new_app, write_results
from studies.fibres import concealed
from studies.fibres.bare import AT_MM, RATIOS, case_of, correction_of
from studies.fibres.table import tabulate

app = new_app()


def figure_of(found: dict[float, tuple[FloatArray, FloatArray]]) -> Figure:
    """Return the force of fibrous muscle over that of muscle alike in all directions."""
    figure = Figure(figsize=(6, 3.8), layout="constrained")
    axes = figure.subplots()
    for (ratio, (_, force)), style in zip(found.items(), ("-", "--", "-.", ":"), strict=True):
        axes.plot(AT_MM, force / found[1.0][1], style, color="black", label=rf"$\mu_L/\mu_T$ = {ratio:g}")
    axes.set(xlabel="displacement (mm)", ylabel="3D force over that without fibres")
    figure.legend(loc="outside right upper", frameon=False)
    return figure


def write_table(folder: Path, jobs: int, progress: Progress) -> None:
    """Write the table of fibres, and print it with its errors."""
    found = tabulate(folder / "solved", jobs, progress)
    logs = [found.log_at(ratio, AT_MM) for ratio in found.ratio]
    cells = [*(np.exp(log) for log in logs), *found.errors_at(AT_MM).values()]
    names = [
        *(f"factor at a ratio of {ratio:g}" for ratio in found.ratio),
        *(f"error by the {name}" for name in found.errors),
    ]
    rows = [[name, *(f"{value:.3f}" for value in row)] for name, row in zip(names, cells, strict=True)]
    typer.echo(markdown_table(["", *(f"{d:g} mm" for d in AT_MM)], rows))
    typer.echo(f"table: {found.write(folder / FIBRES_TABLE.name)}")


def diagnose_concealed(folder: Path, jobs: int, progress: Progress, seed: int | None) -> None:
    """Diagnose legs whose fibres are concealed, and print what is found."""
    cases = concealed.CASES if seed is None else concealed.drawn_cases(seed)
    progress.stage("legs with concealed fibres", len(cases))
    found = []
    for number, case in enumerate(cases):
        found.append((case, concealed.diagnosed(case, number, folder, jobs, progress)))
        rows = markdown_table(concealed.HEADER, [concealed.cells(*one) for one in found])
        write_atomically(folder / "concealed.md", f"{rows}\n\n{concealed.score(found)}\n")
    typer.echo(f"{rows}\n\n{concealed.score(found)}")


@app.command()
def fibres(
    coarse: Annotated[bool, typer.Option("--coarse", help="A quick look on a coarse mesh.")] = False,
    table: Annotated[
        bool, typer.Option("--table", help="The table that legfem ships, of a leg with fat and fascia, instead.")
    ] = False,
    conceal: Annotated[
        bool, typer.Option("--concealed", help="Diagnoses of legs whose fibres are concealed, instead.")
    ] = False,
    seed: Annotated[
        int | None, typer.Option("--seed", help="Of legs that are drawn, with --concealed; five set ones without it.")
    ] = None,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Press a cylinder of 50 mm into an idealised leg whose muscle is stiffer along it.

    Solutions are kept as they are done: the same command goes on where it was stopped.

    Example: python -m studies.fibres --coarse
    """
    with study_context("fibres", out, jobs, DONE_IS_KEPT) as (folder, processes), progress_on() as progress:
        if table:
            write_table(folder, processes, progress)
            return
        if conceal:
            diagnose_concealed(folder, processes, progress, seed)
            return
        progress.stage("pressing legs with fibres", len(RATIOS))
        cases = [case_of(ratio, coarse) for ratio in RATIOS]
        solved = run_cases(cases, folder / "solved", processes, progress)
        found = {ratio: correction_of(one) for ratio, one in zip(RATIOS, solved, strict=True)}
        rows = markdown_table(
            ["shear moduli along / across", *(f"P at {d:g} mm" for d in AT_MM), "force over none"],
            [
                [f"{ratio:g}", *(f"{value:.3f}" for value in P), f"{force[-1] / found[1.0][1][-1]:.3f}"]
                for ratio, (P, force) in found.items()
            ],
        )
        ratios = [{"ratio": ratio, "P": P, "force_N": force} for ratio, (P, force) in found.items()]
        write_results(folder, {"displacement_mm": AT_MM, "ratios": ratios}, rows)
        save(figure_of(found), folder, "fibres")


if __name__ == "__main__":
    app(prog_name="python -m studies.fibres")

"""``python -m studies.worked``."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from legfem.common.command_line import study_context
from legfem.common.documents import markdown_table, write_atomically, write_document
from legfem.common.progress import progress_on
from legfem.inverse.correction import read_correction
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.finite_element_models import library_folder
from studies.command_line import DONE_IS_KEPT, Jobs, Library, Out, new_app
from studies.worked.ends import run_ends
from studies.worked.example import FIGURE, ExampleRow
from studies.worked.stiffening import run_stiffening

QUANTITIES = (
    "truth",
    "left out by the base model",
    "base fit: C10 (kPa)",
    "base fit: R2",
    "base fit: probability that it suffices",
    "verdict",
    "named",
    "repaired fit: C10 (kPa)",
    "repaired fit: the effect's strength",
    "held-out error before (N)",
    "held-out error after (N)",
    "noise of what is held out (N)",
)


def cells(row: ExampleRow) -> tuple[str, ...]:
    """Return a row's entries, in the order of `QUANTITIES`."""
    truth = row.truth
    stiffness = f"C10 {truth.c10_kpa:g}" + (f", C20 {truth.c20_kpa:g}" if truth.c20_kpa else "")
    return (
        f"{stiffness} kPa",
        truth.effect,
        _stiffness(row.base_c10, row.base_interval, truth.c10_kpa),
        f"{row.base_r_squared:.4f}",
        f"{row.base_probability:.2g}",
        row.verdict,
        " | ".join(" + ".join(names) for names in row.models) or "-",
        _stiffness(row.repaired_c10, row.repaired_interval, truth.c10_kpa),
        _with_interval(row.strength, row.strength_interval),
        f"{row.held_out_before:.3f}",
        "-" if row.held_out_after is None else f"{row.held_out_after:.3f}",
        f"{row.held_out_noise:.3f}",
    )


def _with_interval(value: float | None, interval: tuple[float, float] | None) -> str:
    if value is None or interval is None:
        return "-"
    return f"{value:.3f} [{interval[0]:.3f}, {interval[1]:.3f}]"


def _stiffness(value: float | None, interval: tuple[float, float] | None, true: float) -> str:
    if value is None:
        return "-"
    return f"{_with_interval(value, interval)}, {100 * (value / true - 1):+.1f} %"


def terminal_table(rows: Sequence[ExampleRow]) -> Table:
    """Return the table for the terminal, a column an example."""
    table = Table(title="Worked examples (simulated data; intervals are 95 %)")
    table.add_column("")
    for row in rows:
        table.add_column(row.name)
    for entries in zip(QUANTITIES, *map(cells, rows), strict=True):
        table.add_row(*entries)
    return table


def page(rows: Sequence[ExampleRow], figures: Sequence[str]) -> str:
    """Return the page with the table and a figure an example."""
    entries = list(zip(QUANTITIES, *map(cells, rows), strict=True))
    lines = ["# Worked examples", "", "Simulated data; intervals are 95 %.", ""]
    lines.append(markdown_table(["", *(row.name for row in rows)], entries).rstrip())
    for row, figure in zip(rows, figures, strict=True):
        lines += ["", f"Truth of *{row.name}*: {row.truth.discretisation}.", ""]
        lines += [f"![{row.name}, simulated data]({figure})"]
    return "\n".join(lines) + "\n"


def run(examples: Sequence[str], out: Path, library: Path, jobs: int) -> None:
    """Make, diagnose and tabulate the examples; solutions are kept in the library.

    What the slow loadings leave ambiguous in the first example is recorded once more, with a
    hold and unloading: both rows stay.
    """
    correction = read_correction(REFERENCE)
    rows: list[ExampleRow] = []
    figures: list[str] = []

    def keep(row: ExampleRow, folder: Path) -> None:
        rows.append(row)
        figures.append((folder / FIGURE).relative_to(out).as_posix())
        write_document(
            out / "result.json", {"schema": 1, "origin": "simulated", "examples": [r.document() for r in rows]}
        )
        write_atomically(out / "report.md", page(rows, figures))

    with progress_on() as progress:
        if "strain-stiffening" in examples:
            folder = out / "strain-stiffening"
            keep(run_stiffening("ramps", folder, library, correction, jobs, progress), folder)
            if rows[-1].verdict == "ambiguous":
                folder = out / "strain-stiffening-holds"
                keep(run_stiffening("holds", folder, library, correction, jobs, progress), folder)
        if "end-effects" in examples:
            folder = out / "end-effects"
            keep(run_ends(folder, library, correction, jobs, progress), folder)
    Console(width=150).print(terminal_table(rows))
    print(f"result: {out / 'result.json'}\nreport: {out / 'report.md'}")


class WorkedExample(StrEnum):
    """What the base model leaves out."""

    STRAIN_STIFFENING = "strain-stiffening"
    END_EFFECTS = "end-effects"


app = new_app()


@app.command()
def worked(
    example: Annotated[list[WorkedExample] | None, typer.Option(help="Only this one; both by default.")] = None,
    library: Library = None,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Two worked diagnoses of what the first paper left out: strain stiffening and 3D ends.

    Recordings are simulated on another discretisation and diagnosed end to end. Solutions are kept
    as they are done: the same command goes on where it was stopped.

    Example: python -m studies.worked
    """
    with study_context("worked", out, jobs, DONE_IS_KEPT) as (folder, processes):
        chosen = [entry.value for entry in example or WorkedExample]
        run(chosen, folder, library or library_folder(), processes)


if __name__ == "__main__":
    app(prog_name="python -m studies.worked")

"""What ``python -m studies.worked`` does and writes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from legfem.common.documents import write_atomically, write_document
from legfem.common.progress import progress_on
from legfem.legs.correction import read_correction
from legfem.legs.correction_of_leg import REFERENCE
from studies.worked.ends import run_ends
from studies.worked.example import FIGURE, ExampleRow
from studies.worked.page import page, terminal_table
from studies.worked.stiffening import run_stiffening


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

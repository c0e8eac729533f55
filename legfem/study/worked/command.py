"""What ``python -m legfem.study worked`` does and writes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from legfem.correction import read_correction
from legfem.documents import write_atomically, write_document
from legfem.identify.correction import REFERENCE
from legfem.progress import progress_on
from legfem.study.worked.ends import run_ends
from legfem.study.worked.example import FIGURE, Row
from legfem.study.worked.page import page, terminal_table
from legfem.study.worked.stiffening import run_stiffening


def run(examples: Sequence[str], out: Path, library: Path, jobs: int) -> None:
    """Make, diagnose and tabulate the examples; solutions are kept in the library.

    What the slow loadings leave ambiguous in the first example is recorded once more, at two rates
    with holds: both rows stay.
    """
    correction = read_correction(REFERENCE)
    rows: list[Row] = []
    figures: list[str] = []

    def keep(row: Row, folder: Path) -> None:
        rows.append(row)
        figures.append((folder / FIGURE).relative_to(out).as_posix())
        write_document(
            out / "result.json",
            {"schema": 1, "origin": "simulated", "examples": [r.document() for r in rows]},
        )
        write_atomically(out / "report.md", page(rows, figures))

    with progress_on() as progress:
        if "strain-stiffening" in examples:
            folder = out / "strain-stiffening"
            keep(run_stiffening("ramps", folder, library, correction, jobs, progress), folder)
            if rows[-1].verdict == "ambiguous":
                folder = out / "strain-stiffening-rates"
                keep(run_stiffening("rates", folder, library, correction, jobs, progress), folder)
        if "end-effects" in examples:
            folder = out / "end-effects"
            keep(run_ends(folder, library, correction, jobs, progress), folder)
    Console(width=150).print(terminal_table(rows))
    print(f"result: {out / 'result.json'}\nreport: {out / 'report.md'}")

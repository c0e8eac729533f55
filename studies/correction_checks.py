"""``python -m studies.correction_checks``: how far the 3D model goes, what tetrahedra make of it.

On the default mesh, for soft, stiff and stiffening tissue; and with first-order tetrahedra.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from itertools import product
from pathlib import Path

import numpy as np
from mpi4py import MPI
from rich.console import Console
from rich.table import Table

from legfem.common.command_line import study_context
from legfem.common.documents import write_document
from legfem.common.progress import Progress, progress_on
from legfem.inverse.correction import smooth_ratio
from legfem.study.correction.calibration import run_cases, stiffened
from legfem.study.correction.cases import CaseOutcome, CorrectionCase
from studies.command_line import DONE_IS_KEPT, Jobs, Out, new_app

REACH = 30.0
"""mm."""
C10_KPA = (0.2, 1.0, 5.0)
STIFFENING = (0.0, 0.8)
"""C20 / (C10 + C20): neo-Hookean tissue, and the table's stiffest reduced polynomial."""
FINER = 2.0
"""Of the finer grid of tetrahedra."""

app = new_app()


@app.command()
def command(out: Out = None, jobs: Jobs = None) -> None:
    """Press the 3D correction's reference leg to 30 mm, and once with first-order tetrahedra.

    Example: python -m studies.correction_checks, or mpirun -n 4 python -m studies.correction_checks
    """
    comm = MPI.COMM_WORLD
    with (
        study_context("correction-checks", out, jobs, DONE_IS_KEPT) as (folder, processes),
        progress_on(quiet=comm.rank > 0) as progress,
    ):
        processes = processes if comm.size == 1 else 1
        check(CorrectionCase(), folder, folder / "cases", processes, progress, comm)


def check(reference: CorrectionCase, out: Path, kept: Path, jobs: int, progress: Progress, comm: MPI.Intracomm) -> None:
    """Press to 30 mm for soft, stiff and stiffening tissue, and once with tetrahedra; collective.

    Parameters
    ----------
    reference
        The leg on the default mesh.
    out, kept
        Folders for the result and for the solved cases.
    jobs, progress, comm
        As those of `legfem.study.correction.calibration.calibrate`.
    """
    reaching = [
        replace(reference, depth=REACH, material=stiffened(reference.material, c10, q))
        for c10, q in product(C10_KPA, STIFFENING)
    ]
    elements = {
        "second-order hexahedra, mixed": reference,
        "first-order tetrahedra": with_tetrahedra(reference),
        f"the same, edges / {FINER:g}": with_tetrahedra(reference, FINER),
    }
    progress.stage(f"the default mesh to {REACH:g} mm; tetrahedra", len(reaching) + len(elements))
    cases = [*reaching, *elements.values()]
    outcomes = run_cases(cases, kept, jobs, progress, comm)
    if comm.rank:
        return
    count = len(reaching)
    by_elements = dict(zip(elements, outcomes[count:], strict=True))
    console = Console(width=110)
    console.print(reach_table(reaching, outcomes[:count]))
    console.print(elements_table(by_elements, reference.depth))
    path = write_document(
        out / "checks.json",
        {
            "schema": 1,
            "cases": [
                {
                    "case": asdict(case),
                    "reached_mm": outcome.reached,
                    "steps": outcome.steps,
                    "rejected": outcome.rejected,
                    "softened": outcome.softened,
                    "factorisations": outcome.factorisations,
                    "unknowns": outcome.unknowns,
                    "force_N": float(outcome.spatial.force[-1]),
                    "balance": outcome.balance,
                }
                for case, outcome in zip(cases, outcomes, strict=True)
            ],
        },
    )
    print(f"checks: {path}", flush=True)


def with_tetrahedra(case: CorrectionCase, finer: float = 1.0) -> CorrectionCase:
    """Return a case with the paper's elements, on the same grid or one with shorter edges."""
    mesh = replace(case.settings.mesh.refined(finer), cells="tetrahedra", degree=1)
    return replace(case, settings=replace(case.settings, mesh=mesh, formulation="displacement"))


def reach_table(cases: Sequence[CorrectionCase], outcomes: Sequence[CaseOutcome]) -> Table:
    """Return how far each material came and what it took, a row a material."""
    table = Table(title=f"The 3D model on {outcomes[0].unknowns} unknowns")
    for name in (
        "C10 (kPa)",
        "C20 (kPa)",
        "reached (mm)",
        "steps",
        "rejected",
        "tangents",
        "contact softened",
        "RF3D (N)",
        "balance",
    ):
        table.add_column(name, justify="right")
    for case, outcome in zip(cases, outcomes, strict=True):
        table.add_row(
            f"{case.material.C10_kPa:g}",
            f"{case.material.C20_kPa:g}",
            f"{outcome.reached:g}",
            f"{outcome.steps}",
            f"{outcome.rejected}",
            f"{outcome.factorisations}",
            "yes" if outcome.softened else "no",
            f"{outcome.spatial.force[-1]:.2f}",
            f"{outcome.balance:.0e}",
        )
    return table


def elements_table(outcomes: Mapping[str, CaseOutcome], depth: float) -> Table:
    """Return forces in 3D and P, a row a kind of elements."""
    depths = np.array([d for d in (5.0, 10.0, 15.0, 20.0, 25.0) if d <= depth])
    table = Table(title="RF3D (N) and P by the elements")
    for name in ("elements", "unknowns", *(f"{d:g} mm" for d in depths)):
        table.add_column(name, justify="right")
    for name, outcome in outcomes.items():
        P = smooth_ratio(outcome.spatial, outcome.plane, depths)
        values = [f"{f:.2f}, {p:+.3f}" for f, p in zip(outcome.spatial(depths), P, strict=True)]
        table.add_row(name, f"{outcome.unknowns}", *values)
    return table


if __name__ == "__main__":
    app(prog_name="python -m studies.correction_checks")

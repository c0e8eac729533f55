"""What ``python -m legfem.study stockings`` does and writes."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

from mpi4py import MPI

from legfem.documents import json_types, write_atomically, write_document
from legfem.errors import InputError
from legfem.geometry.parametric_leg import parametric_leg, read_legs
from legfem.imaging.voxelise import SegmentationNoise
from legfem.progress import Progress, progress_on
from legfem.shipped import STUDIES
from legfem.stocking.run import StockingSettings
from legfem.study.stockings import page
from legfem.study.stockings.claims import (
    Variant,
    correlations,
    read_pressures,
    solve_variant,
    variant_file,
    variants,
)
from legfem.study.stockings.recovery import KINDS, read_recovery, recover, recovery_file
from legfem.study.stockings.sizes import sized_state
from legfem.study.stockings.truth import TRUTHS, true_leg, write_subject
from legfem.workers import Workers

LEGS = STUDIES / "dubuis" / "legs.toml"
NOISE = {"perfect": None, "noisy": SegmentationNoise()}


def make(out: Path, seed: int, jobs: int) -> None:
    """Simulate the six legs' scans: ``out/perfect/1`` and so on; what is there stays."""
    missing = [leg for leg in TRUTHS if not all((_folder(out, k, leg)).is_dir() for k in KINDS)]
    with progress_on() as progress:
        _spread(_make, (out, seed), missing, jobs, progress, "simulated scans")
    print(f"legs: {out}")


def identify(legs: Path, out: Path, settings: StockingSettings, jobs: int) -> None:
    """Identify all legs made; what is done stays."""
    tasks = [(kind, leg) for kind in KINDS for leg in TRUTHS if _folder(legs, kind, leg).is_dir()]
    if not tasks:
        raise InputError("--legs", str(legs), "holds no legs", "make them with --make first")
    open_tasks = [task for task in tasks if not recovery_file(out, *task).is_file()]
    with progress_on() as progress:
        _spread(_identify, (legs, out, settings), open_tasks, jobs, progress, "identification")
    rows = [read_recovery(recovery_file(out, *task)) for task in tasks]
    text = f"{page.recovery_summary(rows)}\n\n{page.recovery_table(rows)}\n"
    write_document(out / "recovery.json", json_types([asdict(row) for row in rows]))
    write_atomically(out / "recovery.md", text)
    print(f"{text}report: {out / 'recovery.md'}")


def claims(out: Path, cells: int, jobs: int) -> None:
    """Put stockings on legs of different shape, and test the paper's claims."""
    every = variants(list(read_legs(LEGS)))
    missing = [variant for variant in every if not variant_file(out, variant).is_file()]
    with progress_on() as progress:
        _spread(_claim, (out, cells), missing, jobs, progress, "legs in stockings")
    rows = [read_pressures(variant_file(out, variant)) for variant in every]
    found = correlations(rows)
    text = f"{page.correlation_table(found)}\n\n{page.pressure_table(rows)}\n"
    write_document(
        out / "claims.json",
        json_types({"legs": [asdict(r) for r in rows], "claims": [asdict(c) for c in found]}),
    )
    write_atomically(out / "claims.md", text)
    print(f"{text}report: {out / 'claims.md'}")


def sizes(cells: int) -> None:
    """Solve for one state of leg 1 on this run's ranks, and print what it took."""
    shape = parametric_leg(read_legs(LEGS)["1"])
    found = sized_state(shape, cells, MPI.COMM_WORLD)
    if MPI.COMM_WORLD.rank == 0:
        print(found)


def _folder(out: Path, kind: str, leg: str) -> Path:
    return out / kind / leg


def _spread[Context, Task](
    work: Callable[[Context, Task], str],
    context: Context,
    tasks: list[Task],
    jobs: int,
    progress: Progress,
    stage: str,
) -> None:
    progress.stage(stage, len(tasks))
    with Workers(work, context, jobs) as workers:
        for task, line in workers.run(tasks):
            progress.advance(f"{task}: {line}")


def _make(context: tuple[Path, int], leg: str) -> str:
    out, seed = context
    started = time.process_time()
    made = true_leg(read_legs(LEGS)[leg], TRUTHS[leg])
    if not made.worn.converged:
        return "no equilibrium with the stocking was found; nothing written"
    for kind, noise in NOISE.items():
        write_subject(leg, made, _folder(out, kind, leg), seed, noise)
    return f"{made.worn.state.report}, {time.process_time() - started:.0f} s of processor time"


def _identify(context: tuple[Path, Path, StockingSettings], task: tuple[str, str]) -> str:
    legs, out, settings = context
    kind, leg = task
    # The paper's search takes many solutions: it is compared where the segmentation is perfect.
    chosen = replace(settings, nelder_mead=settings.nelder_mead and kind == "perfect")
    return recover(_folder(legs, kind, leg), out, kind, chosen, time.process_time)


def _claim(context: tuple[Path, int], variant: Variant) -> str:
    out, cells = context
    return solve_variant(read_legs(LEGS)[variant.leg], variant, out, cells)

"""What ``python -m studies.stockings`` does and writes."""

from __future__ import annotations

import shutil
import time
from dataclasses import asdict, replace
from pathlib import Path

from mpi4py import MPI

from legfem.common.documents import json_types, write_atomically, write_document
from legfem.common.errors import InputError
from legfem.common.progress import progress_on
from legfem.jobs.key import Contents, key_of
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, finish
from legfem.stockings.result import StockingSettings
from studies.legs.parametric_leg import parametric_leg, read_legs
from studies.stockings import page
from studies.stockings.claims import Pressures, Variant, correlations, solve_variant, variants
from studies.stockings.recovery import Recovery, recover
from studies.stockings.sizes import sized_state
from studies.stockings.truth import NOISE, TRUTHS, true_leg, write_subject

LEGS = Path(__file__).with_name("legs.toml")


def make(out: Path, seed: int, jobs: int) -> None:
    """Simulate the six legs' scans: ``out/perfect/1`` and so on; what is there and fits stays."""
    legs = read_legs(LEGS)
    # What is kept of a leg is the hash of its folders.
    store = Store(out / "made", str, seed, ("studies.stockings.truth",), named=lambda one: one[0])
    missing = [leg for leg in TRUTHS if store.get((leg, legs[leg].model_dump())) != _contents(out, leg)]
    with progress_on() as progress, Workers(_make, (out, seed), jobs) as workers:
        progress.stage("simulated scans", len(missing))
        for leg, line in workers.run(missing):
            store.put((leg, legs[leg].model_dump()), _contents(out, leg))
            progress.advance(f"{leg}: {line}")
    print(f"legs: {out}")


def _contents(out: Path, leg: str) -> str:
    return key_of(*(Contents(_folder(out, kind, leg)) for kind in NOISE))


def identify(legs: Path, out: Path, settings: StockingSettings, jobs: int) -> None:
    """Identify all legs made; what is done stays."""
    tasks = [(kind, leg) for kind in NOISE for leg in TRUTHS if (_folder(legs, kind, leg) / "leg.toml").is_file()]
    if not tasks:
        raise InputError("--legs", str(legs), "holds no legs", "make them with --make first")
    # The paper's search takes many solutions: it is compared where the segmentation is perfect.
    chosen = {kind: replace(settings, nelder_mead=settings.nelder_mead and kind == "perfect") for kind in NOISE}
    modules = ("studies.stockings.recovery",)
    store = Store(out / "runs", Recovery, modules=modules, named=lambda one: "-".join(one[0]))
    with progress_on() as progress, Workers(_identify, (legs, chosen), jobs) as workers:
        rows = finish(
            workers,
            tasks,
            store,
            progress,
            "identification",
            lambda task, row: f"{task}: {row}",
            asked=lambda task: (task, chosen[task[0]], Contents(_folder(legs, *task))),
        )
    text = f"{page.recovery_summary(rows)}\n\n{page.recovery_table(rows)}\n"
    write_document(out / "recovery.json", json_types([asdict(row) for row in rows]))
    write_atomically(out / "recovery.md", text)
    print(f"{text}report: {out / 'recovery.md'}")


def claims(out: Path, cells: int, jobs: int) -> None:
    """Put stockings on legs of different shape, and test the paper's claims."""
    legs = read_legs(LEGS)
    store = Store(out / "variants", Pressures, cells, ("studies.stockings.claims",), named=lambda one: one[0].name)
    with progress_on() as progress, Workers(_claim, cells, jobs) as workers:
        rows = finish(
            workers,
            variants(list(legs)),
            store,
            progress,
            "legs in stockings",
            lambda variant, row: f"{variant.name}: {row}",
            asked=lambda variant: (variant, legs[variant.leg].model_dump()),
        )
    found = correlations(rows)
    text = f"{page.correlation_table(found)}\n\n{page.pressure_table(rows)}\n"
    write_document(
        out / "claims.json", json_types({"legs": [asdict(r) for r in rows], "claims": [asdict(c) for c in found]})
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


def _make(context: tuple[Path, int], leg: str) -> str:
    out, seed = context
    started = time.process_time()
    for kind in NOISE:
        shutil.rmtree(_folder(out, kind, leg), ignore_errors=True)
    made = true_leg(read_legs(LEGS)[leg], TRUTHS[leg])
    if not made.equilibrium.converged:
        return "no equilibrium with the stocking was found; nothing written"
    for kind, noise in NOISE.items():
        write_subject(leg, made, _folder(out, kind, leg), seed, noise)
    return f"{made.equilibrium.state.report}, {time.process_time() - started:.0f} s of processor time"


def _identify(context: tuple[Path, dict[str, StockingSettings]], task: tuple[str, str]) -> Recovery:
    legs, settings = context
    return recover(_folder(legs, *task), task[0], settings[task[0]])


def _claim(cells: int, variant: Variant) -> Pressures:
    return solve_variant(read_legs(LEGS)[variant.leg], variant, cells)

"""What ``python -m studies.stockings`` does and writes, its tables in Markdown."""

from __future__ import annotations

import shutil
import time
from collections.abc import Sequence
from dataclasses import asdict
from itertools import groupby
from pathlib import Path

from mpi4py import MPI

from legfem.common.documents import Contents, json_types, markdown_table, write_atomically, write_document
from legfem.common.errors import InputError
from legfem.common.progress import progress_on
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, finish, key_of
from studies.making.shapes import parametric_leg, read_legs
from studies.stockings.claims import Correlation, Pressures, Variant, correlations, sized_state, solve_variant, variants
from studies.stockings.truth import NOISE, TRUTHS, Recovery, recover, true_leg, write_subject


def recovery_table(rows: Sequence[Recovery]) -> str:
    """Return planted and found stiffnesses, a row a leg and kind of segmentation."""
    found = (f"{tissue} (kPa), 95 %" for tissue in ("muscle", "fat"))
    head = ("leg", "segmentation", "planted (kPa): muscle, fat", *found, "equilibria", "rms (mm)")
    return markdown_table(head, [_recovery(row) for row in sorted(rows, key=lambda r: (r.kind, r.leg))])


def recovery_summary(rows: Sequence[Recovery]) -> str:
    """Return one line a kind of segmentation: how many intervals hold the planted value."""
    lines = []
    for kind, group in groupby(sorted(rows, key=lambda r: r.kind), key=lambda r: r.kind):
        legs = list(group)
        muscle, fat = (sum(row.covered[k] for row in legs) for k in range(2))
        lines.append(
            f"- {kind} segmentation: {len(legs)} legs; the interval holds the planted C10 of "
            f"muscle in {muscle} and of fat in {fat}."
        )
    return "\n".join(lines)


def pressure_table(rows: Sequence[Pressures]) -> str:
    """Return the pressures, a row a variant."""
    head = (
        "leg",
        "fat",
        "class",
        "fat thickness (mm)",
        "skin: mean, greatest (kPa)",
        "veins: posterior tibial, fibular, anterior tibial (kPa)",
        "veins / mean skin",
        "muscle: mean (kPa)",
        "fat: greatest (kPa)",
    )
    return markdown_table(head, [_pressures(row) for row in rows])


def correlation_table(rows: Sequence[Correlation]) -> str:
    """Return the claims' correlations."""
    cells = []
    for one in rows:
        both = (one.pearson, one.pearson_p), (one.spearman, one.spearman_p)
        cells.append((one.statement, str(one.count), *(f"{r:+.2f} ({p:.1g})" for r, p in both)))
    return markdown_table(("claim", "legs", "Pearson r (p)", "Spearman rho (p)"), cells)


def _recovery(row: Recovery) -> tuple[str, ...]:
    estimates = (
        f"{one.value:.2f} [{one.low:.2f}, {one.high:.2f}]{'' if held else ' (missed)'}"
        for one, held in zip(row.found, row.covered, strict=True)
    )
    planted = f"{row.planted[0]:g}, {row.planted[1]:g}"
    return (row.leg, row.kind, planted, *estimates, str(row.solves), f"{row.rms_mm:.3f}")


def _pressures(row: Pressures) -> tuple[str, ...]:
    variant = row.variant
    return (
        variant.leg,
        f"x {variant.fat_factor:g}",
        variant.compression_class,
        f"{row.fat_thickness:.1f}",
        f"{row.mean_interface:.2f}, {row.greatest_interface:.2f}",
        ", ".join(f"{p:.2f}" for p in row.at_veins),
        f"{row.mean_at_veins / row.mean_interface:.2f}",
        f"{row.mean_in_muscle:.2f}",
        f"{row.greatest_in_fat:.2f}" + ("" if row.converged else " (not converged)"),
    )


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
    return key_of(*(Contents(out / kind / leg) for kind in NOISE))


def identify(legs: Path, out: Path, cells: int, jobs: int) -> None:
    """Identify all legs made; what is done stays."""
    tasks = [(kind, leg) for kind in NOISE for leg in TRUTHS if (legs / kind / leg / "leg.toml").is_file()]
    if not tasks:
        raise InputError("--legs", str(legs), "contains no legs", "make them with --make first")
    modules = ("studies.stockings.truth",)
    store = Store(out / "runs", Recovery, modules=modules, named=lambda one: "-".join(one[0]))
    with progress_on() as progress, Workers(_identify, (legs, cells), jobs) as workers:
        rows = finish(
            workers,
            tasks,
            store,
            progress,
            "identification",
            lambda task, row: f"{task}: {row}",
            asked=lambda task: (task, cells, Contents(legs.joinpath(*task))),
        )
    text = f"{recovery_summary(rows)}\n\n{recovery_table(rows)}\n"
    _write(out / "recovery.json", [asdict(row) for row in rows], text)


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
    text = f"{correlation_table(found)}\n\n{pressure_table(rows)}\n"
    document = {"legs": [asdict(row) for row in rows], "claims": [asdict(claim) for claim in found]}
    _write(out / "claims.json", document, text)


def _write(path: Path, document: object, text: str) -> None:
    """Write numbers, and tables beside them, and print the latter."""
    page = path.with_suffix(".md")
    write_document(path, json_types(document))
    write_atomically(page, text)
    print(f"{text}report: {page}")


def sizes(cells: int) -> None:
    """Solve for one state of leg 1 on this run's ranks, and print what it took."""
    shape = parametric_leg(read_legs(LEGS)["1"])
    found = sized_state(shape, cells, MPI.COMM_WORLD)
    if MPI.COMM_WORLD.rank == 0:
        print(found)


def _make(context: tuple[Path, int], leg: str) -> str:
    out, seed = context
    started = time.process_time()
    for kind in NOISE:
        shutil.rmtree(out / kind / leg, ignore_errors=True)
    made = true_leg(read_legs(LEGS)[leg], TRUTHS[leg])
    if not made.equilibrium.converged:
        return "no equilibrium with the stocking was found; nothing written"
    for kind, noise in NOISE.items():
        write_subject(leg, made, out / kind / leg, seed, noise)
    return f"{made.equilibrium.state.report}, {time.process_time() - started:.0f} s of processor time"


def _identify(context: tuple[Path, int], task: tuple[str, str]) -> Recovery:
    legs, cells = context
    return recover(legs.joinpath(*task), task[0], cells)


def _claim(cells: int, variant: Variant) -> Pressures:
    return solve_variant(read_legs(LEGS)[variant.leg], variant, cells)

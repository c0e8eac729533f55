"""What ``python -m legfem.study recordings`` does and writes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from legfem.documents import write_document
from legfem.errors import InputError
from legfem.progress import progress_on
from legfem.study.recordings.compression import ENDS, Compressed, fitted_c10, study_kind
from legfem.study.recordings.data import phantom_kinds, read_meat, read_phantoms
from legfem.study.recordings.figures import draw_compressed, draw_indented
from legfem.study.recordings.indentation import (
    Assumed,
    Indented,
    predict_next,
    study_indentation,
)

CHOSEN = (
    "RDG1 1A", "RDG1 1B", "RDG1 1D", "FF1 1B", "FF2 2C", "230403-FF1A", "230403-FF1b",
    "230403-RDG1B", "230515-P002-laser-2", "230515-P002-laser-4", "230515-P002-9",
    "230515-P002-10", "230515-P002-11", "230515-P002-12",
)  # fmt: skip
"""Eight of beef, one of them with a drop of force and one with air, and six of silicone."""
REPEATS = (("230515-P002-9", "230515-P002-10"), ("230515-P002-11", "230515-P002-12"))
"""Neighbouring trials on silicone: the first predicts the second."""
DRAWN = ("RDG1 1A", "RDG1 1B", "230403-FF1A", "230515-P002-9")


def run(data: Path, tests: Sequence[str], assumed: Assumed, out: Path, jobs: int) -> None:
    """Study the chosen recordings; print the tables and write result and figures."""
    started = time.perf_counter()
    meat = read_meat(data)
    kinds = phantom_kinds(data)
    unknown = [name for name in tests if name not in meat]
    if unknown:
        raise InputError(
            "--test", unknown[0], "is no test of the data", f"choose from {', '.join(meat)}"
        )
    indented: dict[str, Indented] = {}
    phantoms: dict[str, tuple[Compressed, ...]] = {}
    out.mkdir(parents=True, exist_ok=True)
    with progress_on() as progress:
        progress.stage("indentations", len(tests))
        work = partial(study_indentation, assumed=assumed)
        for one in _each(work, [meat[name] for name in tests], jobs):
            indented[one.test.name] = one
            progress.advance(one.test.name)
        progress.stage("phantoms", len(kinds))
        samples = [read_phantoms(data, kind) for kind in kinds]
        for kind, found in zip(kinds, _each(study_kind, samples, jobs), strict=True):
            phantoms[kind] = found
            progress.advance(kind)
    for name in DRAWN:
        if name in indented:
            draw_indented(indented[name], out / name.replace(" ", "-"))
    for kind, found in phantoms.items():
        draw_compressed(found[0], out / kind)
    console = Console(width=170)
    console.print(_indented_table(indented))
    repeats = {
        pair: predict_next(indented[pair[0]], indented[pair[1]])
        for pair in REPEATS
        if pair[0] in indented and pair[1] in indented
    }
    for (first, second), (before, after) in repeats.items():
        print(f"{second} predicted by {first}: RMSE {before:.4f} N elastic, {after:.4f} N repaired")
    console.print(_compressed_table(phantoms))
    document = {
        "schema": 1,
        "origin": "measured",
        "unit": {"force": "N", "C10": "kPa", "length": "mm", "time": "s"},
        "assumed": {
            "ball_radius_mm": assumed.ball_radius, "layer_radius_mm": assumed.layer_radius,
        },
        "indentations": [_indented_json(found) for found in indented.values()],
        "next_trial": [
            {"fitted": a, "predicted": b, "rmse_elastic_N": e, "rmse_repaired_N": r}
            for (a, b), (e, r) in repeats.items()
        ],
        "phantoms": [_compressed_json(c) for found in phantoms.values() for c in found],
        "wall_s": time.perf_counter() - started,
    }  # fmt: skip
    print(f"result: {write_document(out / 'result.json', document)}")


def _each[Task, Outcome](
    work: Callable[[Task], Outcome], tasks: Sequence[Task], jobs: int
) -> Iterator[Outcome]:
    """Yield the outcomes in the tasks' order, each from a process of its own.

    What is compiled for a process's first model is found again by the next process; a second
    model's expressions would be compiled anew.
    """
    with ProcessPoolExecutor(
        jobs, mp_context=get_context("spawn"), max_tasks_per_child=1
    ) as pool:  # fmt: skip
        yield from pool.map(work, tasks)


def _indented_table(found: dict[str, Indented]) -> Table:
    table = Table(title="Indentations: a ball on a layer (measured data)")
    for name in (
        "test", "material", "air mm", "drop N at mm", "F end/peak", "C10 ramp kPa", "named",
        "C10 kPa", "ratio; time s", "held-out RMSE N: ramp, elastic", "repaired",
    ):  # fmt: skip
        table.add_column(
            name, justify="left" if name in ("test", "named") else "right", overflow="fold"
        )
    for name, one in found.items():
        drops = "; ".join(f"{d.size_N:.3f} at {d.start_mm:.2f}" for d in one.drops)
        ramp, same, after = one.held_out_rmse
        table.add_row(
            name, one.test.material, f"{one.air:.2f}" if one.air else "-", drops or "-",
            f"{one.relaxed:.2f}", f"{one.ramp.values['C10']:.2f}",
            "\n".join(one.repair.names) or "nothing", f"{one.repair.best.values['C10']:.2f}",
            "\n".join(f"{b:.2f}; {t:.2g}" for b, t in branches(one)) or "-",
            f"{ramp:.3f}, {same:.3f}", f"{after:.3f}",
        )  # fmt: skip
    return table


def branches(found: Indented) -> list[tuple[float, float]]:
    """Return ratio and relaxation time (s) of the repaired model's Prony branches."""
    values = found.repair.best.values
    pairs = (
        (values.get(f"viscoelasticity.ratio{k}"), values.get(f"viscoelasticity.relaxation_time{k}"))
        for k in ("", "_2")
    )
    return [(ratio, time) for ratio, time in pairs if ratio is not None and time is not None]


def _compressed_table(found: dict[str, tuple[Compressed, ...]]) -> Table:
    table = Table(title="Phantoms: cylinders between plates, to 40 % strain (measured data)")
    for name in (
        "kind", "samples", "C10 kPa, sliding", "C10 kPa, bonded", "RMSE/peak, sliding", "bonded",
        "better with bonded ends (BIC)", "next sample RMSE/peak, sliding", "bonded",
    ):  # fmt: skip
        table.add_column(name, justify="right")
    for kind, samples in found.items():
        errors = {ends: [_relative(c, ends) for c in samples] for ends in ENDS}
        mean = {ends: np.mean(errors[ends], axis=0) for ends in ENDS}
        table.add_row(
            kind, str(len(samples)),
            *(
                f"{np.mean(c):.2f} ± {np.std(c, ddof=1):.2f}"
                for c in (fitted_c10(samples, ends) for ends in ENDS)
            ),
            *(f"{100 * mean[ends][0]:.2f} %" for ends in ENDS),
            f"{sum(c.better_base.ends == 'bonded' for c in samples)} of {len(samples)}",
            *(f"{100 * mean[ends][1]:.2f} %" for ends in ENDS),
        )  # fmt: skip
    return table


def _relative(found: Compressed, ends: str) -> tuple[float, float]:
    """Return the neo-Hookean fit's error and the next sample's, over the peak force."""
    one = next(f for f in found.fits if f.ends == ends)
    peak = float(found.observed.force.max())
    own = float(np.sqrt(np.mean(one.repair.base.residual**2)))
    return own / peak, one.next_rmse[0] / peak


def _indented_json(found: Indented) -> dict[str, Any]:
    ramp, same, after = found.held_out_rmse
    return {
        "test": found.test.name,
        "material": found.test.material,
        "thickness_mm": found.test.thickness,
        "air_mm": found.air,
        "drops": [vars(drop) for drop in found.drops],
        "force_at_end_over_peak": found.relaxed,
        "C10_ramp_kPa": found.ramp.values["C10"],
        "hold_rmse_by_ramp_N": found.ramp_hold_rmse,
        "named": [{"name": name, "bic_gain": gain} for name, gain in found.repair.gains],
        "parameters_before": dict(found.repair.base.values),
        "parameters_after": dict(found.repair.best.values),
        "held_out_rmse_N": {"ramp_elastic": ramp, "elastic": same, "repaired": after},
        "sum_of_branches_error": found.repair.linear_error,
        "solutions": found.solutions,
    }


def _compressed_json(found: Compressed) -> dict[str, Any]:
    return {
        "sample": found.phantom.recording.trial,
        "peak_N": float(found.observed.force.max()),
        "ends": {
            one.ends: {
                "C10_kPa": one.repair.base.values["C10"],
                "bic": one.repair.base.bic,
                "repaired_bic": one.repair.best.bic,
                "named": [{"name": name, "bic_gain": gain} for name, gain in one.repair.gains],
                "held_out_rmse_N": list(one.held_out_rmse),
                "next_sample_rmse_N": list(one.next_rmse),
            }
            for one in found.fits
        },
    }

"""``python -m studies.recordings``."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from legfem.common.command_line import end_without_a_solution, study_context
from legfem.common.documents import write_document
from legfem.common.errors import InputError
from legfem.common.progress import progress_on
from legfem.common.units import FloatArray
from legfem.jobs.store import Store
from legfem.specimens.laws import laws_named
from studies.command_line import Jobs, Out, new_app
from studies.recordings.curves import ENDS, CompressedPhantom, each_in_turn, elastic_curves, layer_curves, study_kind
from studies.recordings.data import phantom_kinds, read_meat, read_phantoms
from studies.recordings.drawing import draw_compressed, studied
from studies.recordings.folders import write_specimen_folders
from studies.recordings.indentation import Assumed, Row
from studies.recordings.repeats import repeats_table, study_repeats

RELAXES = "viscoelasticity"


def run(data: Path, tests: Sequence[str], assumed: Assumed, out: Path, jobs: int) -> bool:
    """Study the recordings; print the tables and write result and figures.

    Returns whether any indentation came to a result.
    """
    started = time.perf_counter()
    meat = read_meat(data)
    chosen = [full_name(name, list(meat)) for name in tests] or list(meat)
    kinds = phantom_kinds(data)
    out.mkdir(parents=True, exist_ok=True)
    solves = out / "solves"
    phantoms: dict[str, tuple[CompressedPhantom, ...]] = {}
    rows: list[Row] = []
    with progress_on() as progress:
        progress.stage("the layer's elastic force")
        layers = layer_curves(assumed.ball_radius, assumed.layer_radius, solves, jobs, progress.advance)
        progress.stage("indentations", len(chosen))
        store = Store(out / "tests", Row, assumed, ["studies.recordings.indentation"])
        work = partial(studied, layers=layers, store=store, out=out)
        for row in each_in_turn(work, [meat[name] for name in chosen], jobs):
            rows.append(row)
            progress.advance(row.test)
        progress.stage("phantoms", len(kinds))
        for kind in kinds:
            samples = read_phantoms(data, kind)
            phantoms[kind] = study_kind(samples, elastic_curves(samples[0], solves, jobs))
            draw_compressed(phantoms[kind][0], out / kind)
            progress.advance(kind)
    console = Console(width=170)
    told = [row for row in rows if not row.problem]
    console.print(_indented_table(told))
    for row in rows:
        if row.problem:
            print(f"{row.test}: {row.problem}")
    summary = {
        "beef": _summary([row for row in told if row.is_beef]),
        "silicone": _summary([row for row in told if not row.is_beef]),
    }
    for kind, numbers in summary.items():
        print(f"{kind}: " + ", ".join(f"{key} {value:.4g}" for key, value in numbers.items()))
    console.print(_compressed_table(phantoms))
    document = {
        "schema": 2,
        "origin": "measured",
        "unit": {"force": "N", "C10": "kPa", "length": "mm", "time": "s"},
        "assumed": {"ball_radius_mm": assumed.ball_radius, "layer_radius_mm": assumed.layer_radius},
        "summary": summary,
        "indentations": [asdict(row) for row in rows],
        "phantoms": [_compressed_json(c) for found in phantoms.values() for c in found],
        "wall_s": time.perf_counter() - started,
    }
    print(f"result: {write_document(out / 'result.json', document)}")
    return bool(told)


def full_name(name: str, names: Sequence[str]) -> str:
    """Return a test's name with its day, which may be left out where one test alone has it."""
    found = [full for full in names if name in (full, full.partition("|")[2])]
    if len(found) != 1:
        problem = "is no test of the data" if not found else f"is the name of {len(found)} tests"
        raise InputError("--test", name, problem, f"choose from {', '.join(found or names)}")
    return found[0]


def _summary(rows: Sequence[Row]) -> dict[str, float]:
    if not rows:
        return {}
    errors = np.array([[r.elastic_rmse, r.alone_rmse, r.after_rmse, r.line_rmse] for r in rows])
    elastic, alone, after, line = np.median(errors, axis=0)
    wrong = np.abs([r.air_error for r in rows if r.air_error is not None])
    leading = [r.explanations[0][0] for r in rows]
    return {
        "tests": len(rows),
        "relaxation_first": float(np.mean([r.named_first == RELAXES for r in rows])),
        "relaxation_in_the_explanation": float(np.mean([RELAXES in names for names in leading])),
        "held_out_rmse_median_elastic_N": float(elastic),
        "held_out_rmse_median_parameters_alone_N": float(alone),
        "held_out_rmse_median_N": float(after),
        "line_rmse_median_N": float(line),
        "ratio_of_medians": float(after / line),
        "air_tests": len(wrong),
        "air_found_within_median_mm": float(np.median(wrong)) if len(wrong) else float("nan"),
        "air_found_within_95_percent_mm": (float(np.quantile(wrong, 0.95)) if len(wrong) else float("nan")),
    }


def _indented_table(rows: Sequence[Row]) -> Table:
    table = Table(title="Indentations: a ball on a layer (measured data)")
    for name in (
        "test",
        "contact mm",
        "F end/peak",
        "C10 elastic kPa",
        "explained by",
        "%",
        "C10 kPa",
        "ratio; time s; spread",
        "held-out RMSE N: elastic",
        "parameters alone",
        "explained",
        "line in ln t",
    ):
        table.add_column(name, justify="left" if name == "test" else "right", overflow="fold")
    for row in rows:
        names, probability = row.explanations[0]
        table.add_row(
            row.test,
            f"{row.first_contact:.2f}",
            f"{row.relaxed:.2f}",
            f"{row.c10_elastic:.2f}",
            "\n".join(names) + (" in part" if row.in_part else "") or "nothing",
            f"{100 * probability:.0f}",
            f"{row.c10:.2f}",
            "; ".join(f"{value:.2g}" for value in row.relaxation) or "-",
            *(f"{rmse:.4f}" for rmse in (row.elastic_rmse, row.alone_rmse, row.after_rmse, row.line_rmse)),
        )
    return table


def _compressed_table(found: dict[str, tuple[CompressedPhantom, ...]]) -> Table:
    table = Table(title="Phantoms: cylinders between plates, to 40 % strain (measured data)")
    for name in (
        "kind",
        "samples",
        "C10 kPa, sliding",
        "C10 kPa, bonded",
        "RMSE/peak, sliding",
        "bonded",
        "better with bonded ends",
        "beyond 30 %, sliding",
        "bonded",
        "next sample, sliding",
        "bonded",
    ):
        table.add_column(name, justify="right")
    for kind, samples in found.items():
        fits = [[c.with_ends(ends) for c in samples] for ends in ENDS]
        peaks = np.array([c.force.max() for c in samples])
        c10 = [np.array([f.c10 for f in own]) for own in fits]
        table.add_row(
            kind,
            str(len(samples)),
            *(f"{np.mean(c):.2f} ± {np.std(c, ddof=1):.2f}" for c in c10),
            *(_percent([f.rmse for f in own], peaks) for own in fits),
            f"{sum(c.better.ends == 'bonded' for c in samples)} of {len(samples)}",
            *(_percent([f.beyond_rmse for f in own], peaks) for own in fits),
            *(_percent([f.next_rmse for f in own], peaks) for own in fits),
        )
    return table


def _percent(errors: Sequence[float], peaks: FloatArray) -> str:
    return f"{100 * np.mean(np.array(errors) / peaks):.2f} %"


def _compressed_json(found: CompressedPhantom) -> dict[str, Any]:
    return {
        "sample": found.phantom.recording.trial,
        "peak_N": float(found.force.max()),
        "ends": {
            one.ends: {
                "C10_kPa": one.c10,
                "rmse_N": one.rmse,
                "beyond_rmse_N": one.beyond_rmse,
                "next_sample_rmse_N": one.next_rmse,
            }
            for one in found.fits
        },
    }


app = new_app()


@app.command()
def recordings(
    data: Annotated[Path, typer.Option(help="Folder with the two public sets of recordings.")],
    test: Annotated[list[str] | None, typer.Option(help="Indentation by its name; all by default.")] = None,
    ball_radius: Annotated[
        float, typer.Option(min=0.1, help="Of the indenter, which the data don't state (mm).")
    ] = 5.0,
    layer_radius: Annotated[float, typer.Option(min=1.0, help="Of the specimens (mm).")] = 40.0,
    specimen_folders: Annotated[
        Path | None, typer.Option(help="Only write the data as folders for legfem.identify --specimen-dir.")
    ] = None,
    repeats: Annotated[
        str, typer.Option(help="Only fit each phantom's test by itself, of unknown ends, with this law.")
    ] = "",
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Diagnose public recordings of beef and silicone: what the elastic model leaves out.

    Example: python -m studies.recordings --data ../shared/data
    """
    with study_context("recordings", out, jobs) as (folder, processes):
        assumed = Assumed(ball_radius, layer_radius)
        if repeats:
            with progress_on() as progress:
                rows = study_repeats(data, folder / "folders", laws_named(repeats), folder, processes, progress)
            print("\n".join(repeats_table(rows)))
            return
        if specimen_folders is not None:
            for made in write_specimen_folders(data, specimen_folders, assumed):
                print(made)
            return
        if not run(data, test or [], assumed, folder, processes):
            end_without_a_solution("recordings")


if __name__ == "__main__":
    app(prog_name="python -m studies.recordings")

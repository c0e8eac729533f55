"""What ``python -m legfem.study planted`` does and writes."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from legfem.documents import write_document
from legfem.progress import progress_on
from legfem.study.planted import Planted, Truth, coverage, planted_truths, study_planted
from legfem.subject import SUBJECTS


def run(number: int, seed: int, out: Path, jobs: int) -> None:
    """Identify planted truths, print the table and write it; a rerun goes on."""
    truths = planted_truths(number, seed, SUBJECTS.names)
    path = out / "result.json"
    done = _recall(path, truths)
    waiting = [truth for truth in truths if truth.number not in done]
    with progress_on() as progress:
        progress.stage(f"simulating and identifying ({len(done)} known)", len(waiting))
        for case in study_planted(waiting, jobs):
            done[case.truth.number] = case
            write_document(path, _document([done[k] for k in sorted(done)]))
            progress.advance(_line(case))
    found = [done[truth.number] for truth in truths]
    Console(width=120).print(planted_table(found))
    for parameter in ("c10", "c20"):
        share, low, high = coverage(found, parameter)
        print(f"{parameter}: 95 % intervals cover {share:.1%} of {number} truths "
              f"(95 % interval of that share: {low:.1%} to {high:.1%})")  # fmt: skip
    print(f"result: {path}")


def planted_table(found: list[Planted]) -> Table:
    """Return a row a truth; a star marks an interval that misses."""
    table = Table(title="Planted truths (kPa), simulated data")
    for name in ("subject", "true C10", "C10", "95 %", "true C20", "C20", "95 %", "solves"):
        table.add_column(name, justify="right")
    for case in found:
        truth = case.truth
        table.add_row(
            truth.subject, f"{truth.c10_kpa:.3f}", f"{case.c10:.3f}",
            _interval(case.c10_interval, case.c10_covered), f"{truth.c20_kpa:.3f}",
            f"{case.c20:.3f}", _interval(case.c20_interval, case.c20_covered),
            str(case.forward_solves),
        )  # fmt: skip
    return table


def _interval(interval: tuple[float, float], covered: bool) -> str:
    return f"{interval[0]:.3f} to {interval[1]:.3f}{'' if covered else ' *'}"


def _line(case: Planted) -> str:
    return (
        f"C10 {case.truth.c10_kpa:.3f} -> {case.c10:.3f}, "
        f"C20 {case.truth.c20_kpa:.3f} -> {case.c20:.3f} kPa, {case.forward_solves} solves"
    )


def _document(found: list[Planted]) -> dict[str, Any]:
    return {"schema": 1, "unit": "kPa", "origin": "simulated", "cases": [asdict(c) for c in found]}


def _recall(path: Path, truths: list[Truth]) -> dict[int, Planted]:
    """Return the cases of an earlier run that belong to the same truths."""
    if not path.is_file():
        return {}
    known = {}
    for entry in json.loads(path.read_text(encoding="utf-8"))["cases"]:
        truth = Truth(**entry["truth"])
        if truth in truths:
            intervals = {key: tuple(entry[key]) for key in ("c10_interval", "c20_interval")}
            known[truth.number] = Planted(**{**entry, **intervals, "truth": truth})
    return known

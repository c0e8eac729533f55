"""``python -m studies.bench``: what legfem costs, beside the counts of the last release."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from legfem.common.command_line import command_context, leave_to_first_rank
from legfem.common.documents import write_document
from legfem.common.errors import InputError
from studies.bench.work import ASKED, COMPARED, TASKS, done_apart
from studies.command_line import new_app
from studies.counting import Work

KEPT = Path(__file__).parent / "kept.json"
GROWTH = 0.05
"""Of a count, above which the command fails."""

app = new_app()


def grown(works: Mapping[str, Work], kept: Mapping[str, Mapping[str, int]]) -> list[str]:
    """Return which counts have grown by more than `GROWTH`, a line each."""
    return [
        f"{name}: {count} were {kept[name][count]}, are {work.counts[count]}"
        for name, work in works.items()
        if name in kept
        for count in COMPARED
        if work.counts[count] > (1 + GROWTH) * kept[name][count]
    ]


def work_table(works: Mapping[str, Work], kept: Mapping[str, Mapping[str, int]], unit: float | None) -> Table:
    """Return counts with those kept in brackets, seconds (the unit: of a factorisation), and shares by phase."""
    took = f"; {1e3 * unit:.1f} ms for a factorisation of subject 3's tangent" if unit else ""
    table = Table("work", title=f"Counts (those of the last release), and seconds of the processor{took}")
    for heading in (*COMPARED, "seconds", "in factor-\nisations", "MiB", "shares by the clock"):
        table.add_column(heading, justify="right")
    for name, work in works.items():
        before = kept.get(name, {})
        counts = [f"{work.counts[count]} ({before.get(count, '-')})" for count in COMPARED]
        times = f"{work.seconds:.1f}", f"{work.seconds / unit:.0f}" if unit else "-"
        parts = {**work.shares, "else": 1 - sum(work.shares.values())}
        shares = ", ".join(f"{what} {share:.0%}" for what, share in parts.items())
        table.add_row(name, *counts, *times, str(work.peak_MiB), shares)
    return table


@app.command()
def bench(
    tasks: Annotated[
        list[str] | None, typer.Option("--task", help=f"Of {', '.join(TASKS)}; several may be given.")
    ] = None,
    keep: Annotated[bool, typer.Option("--keep", help="Keep the counts as those of a release.")] = False,
) -> None:
    """Print what legfem takes; fail where counts have grown by 5 % since those that were kept.

    Example: python -m studies.bench --task curve --task identify
    """
    leave_to_first_rank()
    with command_context():
        names = tasks or [name for name in TASKS if name not in ASKED]
        for name in names:
            if name not in TASKS:
                raise InputError("--task", name, "is unknown", f"choose of {', '.join(TASKS)}")
        works, kept = {name: done_apart(name) for name in names}, json.loads(KEPT.read_text(encoding="utf-8"))
        unit = next((work.factorisation_seconds for work in works.values() if work.factorisation_seconds), None)
        Console(width=None if Console().is_terminal else 200).print(work_table(works, kept, unit))
        if keep:
            made = {name: {count: work.counts[count] for count in COMPARED} for name, work in works.items()}
            write_document(KEPT, {**kept, **made})
        elif lines := grown(works, kept):
            print("counts have grown:", *lines, sep="\n")
            raise typer.Exit(1)


if __name__ == "__main__":
    app(prog_name="python -m studies.bench")

"""The examples' table: for the terminal, and as a page in Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from legfem.common.documents import markdown_table
from studies.worked.example import ExampleRow

QUANTITIES = (
    "truth",
    "left out by the base model",
    "base fit: C10 (kPa)",
    "base fit: R2",
    "base fit: probability that it suffices",
    "verdict",
    "named",
    "repaired fit: C10 (kPa)",
    "repaired fit: the effect's strength",
    "held-out error before (N)",
    "held-out error after (N)",
    "noise of what is held out (N)",
)


def cells(row: ExampleRow) -> tuple[str, ...]:
    """Return a row's entries, in the order of `QUANTITIES`."""
    truth = row.truth
    stiffness = f"C10 {truth.c10_kpa:g}" + (f", C20 {truth.c20_kpa:g}" if truth.c20_kpa else "")
    return (
        f"{stiffness} kPa",
        truth.effect,
        _stiffness(row.base_c10, row.base_interval, truth.c10_kpa),
        f"{row.base_r_squared:.4f}",
        f"{row.base_probability:.2g}",
        row.verdict,
        " | ".join(" + ".join(names) for names in row.models) or "-",
        _stiffness(row.repaired_c10, row.repaired_interval, truth.c10_kpa),
        _with_interval(row.strength, row.strength_interval),
        f"{row.held_out_before:.3f}",
        "-" if row.held_out_after is None else f"{row.held_out_after:.3f}",
        f"{row.held_out_noise:.3f}",
    )


def _with_interval(value: float | None, interval: tuple[float, float] | None) -> str:
    if value is None or interval is None:
        return "-"
    return f"{value:.3f} [{interval[0]:.3f}, {interval[1]:.3f}]"


def _stiffness(value: float | None, interval: tuple[float, float] | None, true: float) -> str:
    if value is None:
        return "-"
    return f"{_with_interval(value, interval)}, {100 * (value / true - 1):+.1f} %"


def terminal_table(rows: Sequence[ExampleRow]) -> Table:
    """Return the table for the terminal, a column an example."""
    table = Table(title="Worked examples (simulated data; intervals are 95 %)")
    table.add_column("")
    for row in rows:
        table.add_column(row.name)
    for entries in zip(QUANTITIES, *map(cells, rows), strict=True):
        table.add_row(*entries)
    return table


def page(rows: Sequence[ExampleRow], figures: Sequence[str]) -> str:
    """Return the page with the table and a figure an example."""
    entries = list(zip(QUANTITIES, *map(cells, rows), strict=True))
    lines = ["# Worked examples", "", "Simulated data; intervals are 95 %.", ""]
    lines.append(markdown_table(["", *(row.name for row in rows)], entries).rstrip())
    for row, figure in zip(rows, figures, strict=True):
        lines += ["", f"Truth of *{row.name}*: {row.truth.discretisation}.", ""]
        lines += [f"![{row.name}, simulated data]({figure})"]
    return "\n".join(lines) + "\n"

"""The study's tables in Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from legfem.common.documents import markdown_table
from studies.stockings.claims import Correlation, Pressures
from studies.stockings.recovery import Recovery


def recovery_table(rows: Sequence[Recovery]) -> str:
    """Return planted and found stiffnesses, a row a leg and kind of segmentation."""
    head = (
        "leg",
        "segmentation",
        "planted (kPa): muscle, fat",
        "muscle (kPa), 95 %",
        "fat (kPa), 95 %",
        "solves a start",
        "Nelder-Mead (kPa): muscle, fat; solves",
        "paper's cost",
        "rms (mm)",
    )
    return markdown_table(head, [_recovery(row) for row in sorted(rows, key=lambda r: (r.kind, r.leg))])


def recovery_summary(rows: Sequence[Recovery]) -> str:
    """Return one line a kind of segmentation: how many intervals hold the planted value."""
    lines = []
    for kind, group in groupby(sorted(rows, key=lambda r: r.kind), key=lambda r: r.kind):
        legs = list(group)
        muscle, fat = (sum(row.covered[k] for row in legs) for k in range(2))
        agree = sum(row.starts_agree for row in legs)
        lines.append(
            f"- {kind} segmentation: {len(legs)} legs; the interval holds the planted C10 of "
            f"muscle in {muscle} and of fat in {fat}; all starts agree within 5 % in {agree}."
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
    head = ("claim", "legs", "Pearson r (p)", "Spearman rho (p)")
    return markdown_table(
        head,
        [
            (
                row.statement,
                str(row.count),
                f"{row.pearson:+.2f} ({row.pearson_p:.1g})",
                f"{row.spearman:+.2f} ({row.spearman_p:.1g})",
            )
            for row in rows
        ],
    )


def _recovery(row: Recovery) -> tuple[str, ...]:
    simplex = "-"
    if row.nelder_mead is not None:
        muscle, fat = row.nelder_mead
        simplex = f"{muscle:.2f}, {fat:.2f}; {row.nelder_mead_solves}"
    cost = "-" if row.nelder_mead_cost is None else f"{row.nelder_mead_cost:.3f}"
    estimates = (
        f"{value:.2f} [{low:.2f}, {high:.2f}]{'' if held else ' (missed)'}"
        for value, low, high, held in zip(row.found, row.low, row.high, row.covered, strict=True)
    )
    return (
        row.leg,
        row.kind,
        f"{row.planted[0]:g}, {row.planted[1]:g}",
        *estimates,
        ", ".join(map(str, row.solves)),
        simplex,
        cost,
        f"{row.rms_mm:.3f}",
    )


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

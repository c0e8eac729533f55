"""The study's pages: what was concealed, what was found, and case by case."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from legfem.diagnose.choose import MISMATCH
from legfem.documents import json_types
from legfem.study.concealed.calibration import Calibrated
from legfem.study.concealed.scoring import Scored, Summary

SCHEMA = 1


def scored_document(scored: Sequence[Scored], summary: Summary) -> dict[str, Any]:
    """Return the scores as JSON types."""
    return {
        "schema": SCHEMA,
        "origin": "simulated",
        "summary": {
            key: str(value) if not isinstance(value, float | dict) else value
            for key, value in vars(summary).items()
        },
        "cases": [json_types(asdict(case)) for case in scored],
    }


def page(everything: Sequence[Scored], summary: Summary) -> str:
    """Return the page in Markdown; twins count for the name's stability alone."""
    scored = [s for s in everything if s.case.twin_of is None]
    return "\n\n".join([_summary(scored, summary), _confusion(scored)]) + "\n"


def _summary(scored: Sequence[Scored], summary: Summary) -> str:
    before, after = summary.bias_before, summary.bias_after
    right = summary.bias_after_named_rightly
    seconds = [s.seconds for s in scored]
    rows = [
        ("cases, all simulated", f"{len(scored)}"),
        ("base model's refit has R2 above 0.99 in", str(summary.r_squared_above)),
        ("single effects: named first", str(summary.first)),
        ("single effects: named first or in a set of at most 3", str(summary.in_set)),
        ("pairs: both named, first or in a set of at most 3", str(summary.pairs)),
        ("false alarms without effect", str(summary.false_alarms)),
        ("effects outside the library: unexplained or ambiguous", str(summary.outside)),
        ("localisation F1 (all observations of cases with effects)", f"{summary.f1:.2f}"),
        *(
            (
                f"median error of {name[:3].upper()}: before, after repair, after where named "
                "rightly",
                f"{before[name]:.1%}, {after[name]:.1%}, {right[name]:.1%}",
            )
            for name in ("c10_deep", "c20_deep")
        ),
        ("C10 within its 95 % interval after repair, where named rightly", str(summary.covered)),
        ("held-out error within 1.2 times the noise, where named rightly", str(summary.held_out)),
        ("same first name with other noise on the same physics", str(summary.same_name)),
        ("each one's first name in the other's set, with other noise", str(summary.same_answer)),
        ("same verdict on the same name or set, with other noise", str(summary.same_verdict)),
        ("processor seconds a diagnosis, median and longest",
         f"{sorted(seconds)[len(seconds) // 2]:.0f}, {max(seconds):.0f}"),
    ]  # fmt: skip
    return "\n".join(["| | |", "|---|---|", *(f"| {name} | {value} |" for name, value in rows)])


def _confusion(scored: Sequence[Scored]) -> str:
    lines = ["| concealed | cases | named first | in set | called |", "|---|---|---|---|---|"]
    for truth in sorted({_truth(s) for s in scored}):
        mine = [s for s in scored if _truth(s) == truth]
        called = Counter(_called(s) for s in mine)
        lines.append(
            f"| {truth} | {len(mine)} | {sum(s.first for s in mine)} | "
            f"{sum(s.in_set for s in mine)} | "
            + ", ".join(f"{name}: {count}" for name, count in called.most_common())
            + " |"
        )
    return "\n".join(lines)


def cases_page(everything: Sequence[Scored]) -> str:
    """Return the list of cases in Markdown; twins stand beside the case that they repeat."""
    scored = [s for s in everything if s.case.twin_of is None]
    again = {s.case.twin_of: s for s in everything if s.case.twin_of is not None}
    lines = [
        "| case | leg, protocol | concealed | verdict | with other noise | C10 error before, after "
        "| right |",
        "|---|---|---|---|---|---|---|",
    ]
    for s in scored:
        before, after = (b.get("c10_deep", math.nan) for b in (s.bias_before, s.bias_after))
        lines.append(
            f"| {s.case.number} | {s.case.subject}, {s.case.protocol} | {_truth(s)}{_size(s)} | "
            f"{_verdict(s)} | {_verdict(again.get(s.case.number))} | {before:+.1%}, {after:+.1%} | "
            f"{'yes' if s.right else 'no'} |"
        )
    return "\n".join(lines) + "\n"


def _verdict(s: Scored | None) -> str:
    if s is None:
        return ""
    return f"{s.verdict}: {_called(s)}" if s.models else s.verdict


def calibration_page(found: Calibrated) -> str:
    """Return p-values' calibration and the smallest effects in Markdown."""
    lines = [
        f"{len(found.verdict.p_values)} emulated recordings without effect.",
        "",
        f"| p-value | median | Kolmogorov and Smirnov's p | below {MISMATCH:g} | below 0.05 |",
        "|---|---|---|---|---|",
        *(
            f"| {name} | {np.median(own.p_values):.2f} | {own.uniform:.2g} | {own.alarms:.1%} | "
            f"{np.mean(own.p_values < 0.05):.1%} |"
            for name, own in (
                ("of the misfit, which the verdict rests on", found.verdict),
                ("of the strongest window, family-wise", found.windows),
            )
        ),
    ]
    return "\n".join(lines) + "\n"


def _truth(s: Scored) -> str:
    if s.case.kind == "none":
        return "nothing"
    if s.case.kind == "outside":
        return "outside: " + " + ".join(name for name, _ in s.case.outside)
    return " + ".join(s.case.names)


def _size(s: Scored) -> str:
    values = [f"{values[0][1]:.2g}" for _, values in s.case.effects]
    return f" ({', '.join(values)})" if values else ""


def _called(s: Scored) -> str:
    return " or ".join(" + ".join(model) for model in s.models) or s.verdict

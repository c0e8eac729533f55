"""The page of a plan: which tests would show which effects."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

from legfem.diagnose.sentences import percent
from legfem.plan.reckon import Reckoned
from legfem.report.diagnosis_style import plain
from legfem.report.diagnosis_tables import table
from legfem.report.text import WIDTH
from legfem.subjects.subject import Subject

SCHEMA = 1
NOTHING = "nothing"
NOTE = (
    "Chances that a test tells an effect of usual strength from a leg without it (a Bayes "
    "factor of twenty), the stiffness refitted, with what isn't known of the leg and of the "
    "instruments. Simulated; no recording was used. An effect that no test shows may bias the "
    "stiffness unseen."
)


def plan_page(ranked: Sequence[Reckoned], subject: Subject) -> str:
    """Return the text of ``report.txt``: tests of a leg, the most telling first."""
    heading = f"Subject {subject.id} ({subject.title}): which tests would show which effects?"
    tests = "\n".join(
        textwrap.fill(f"({k}) {one.design.name}", WIDTH, subsequent_indent="    ")
        for k, one in enumerate(ranked, 1)
    )
    names = effects_of(ranked)
    rows = [
        [plain(name), *(percent(one.chances[name, NOTHING]) for one in ranked)] for name in names
    ]
    header = ["effect", *(f"({k})" for k in range(1, len(ranked) + 1))]
    return "\n\n".join(
        [
            f"{heading}\n{'=' * min(len(heading), WIDTH)}",
            textwrap.fill(NOTE, WIDTH),
            f"Tests, the most telling first:\n{tests}",
            table(header, rows),
        ]
    ) + "\n"  # fmt: skip


def effects_of(ranked: Sequence[Reckoned]) -> list[str]:
    """Return the names of the effects that were weighed."""
    return sorted({a for one in ranked for a, _ in one.chances if a != NOTHING})


def plan_lines(ranked: Sequence[Reckoned]) -> list[str]:
    """Return tests as sentences, each with the chance that it ends an ambiguity."""
    return [
        f"{one.design.name}: {percent(one.chance)} chance of telling the candidates apart"
        for one in ranked
    ]


def plan_document(ranked: Sequence[Reckoned], subject: str) -> dict[str, Any]:
    """Return the plan as JSON types."""
    return {
        "schema": SCHEMA,
        "subject": subject,
        "origin": "simulated",
        "tests": [
            {
                "test": one.design.name,
                "chance": one.chance,
                "told_apart": [
                    {"if": a, "from": b, "chance": chance} for (a, b), chance in one.chances.items()
                ],
            }
            for one in ranked
        ],
    }

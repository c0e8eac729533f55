"""A plan in sentences and numbers: which tests would show which effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from legfem.inverse.plan import DesignValue
from legfem.report.diagnosis_sentences import percent

SCHEMA = 1
NOTHING = "nothing"
NOTE = (
    "Chances that a test tells an effect of usual strength from a leg without it (a Bayes "
    "factor of twenty), the stiffness refitted, with what isn't known of the leg and of the "
    "instruments. Simulated; no recording was used. An effect that no test shows may bias the "
    "stiffness unseen."
)


def effects_of(ranked: Sequence[DesignValue]) -> list[str]:
    """Return the names of the effects that were weighed."""
    return sorted({a for one in ranked for a, _ in one.chances if a != NOTHING})


def plan_lines(ranked: Sequence[DesignValue]) -> list[str]:
    """Return tests as sentences, each with the chance that it ends an ambiguity."""
    return [f"{one.design.name}: {percent(one.chance)} chance of telling the candidates apart" for one in ranked]


def plan_document(ranked: Sequence[DesignValue], subject: str) -> dict[str, Any]:
    """Return the plan as JSON types."""
    return {
        "schema": SCHEMA,
        "subject": subject,
        "origin": "simulated",
        "tests": [
            {
                "test": one.design.name,
                "chance": one.chance,
                "told_apart": [{"if": a, "from": b, "chance": chance} for (a, b), chance in one.chances.items()],
            }
            for one in ranked
        ],
    }

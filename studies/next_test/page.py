"""The study's page: how many ambiguities the proposed test ended, and a random one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from legfem.common.documents import json_types, markdown_table
from studies.lab.rate import Rate
from studies.next_test.trying import Outcome, Tried


def tried_document(tried: Sequence[Tried]) -> dict[str, Any]:
    """Return all cases as JSON types."""
    return {"schema": 1, "origin": "simulated", "cases": [json_types(asdict(t)) for t in tried]}


def page(tried: Sequence[Tried]) -> str:
    """Return the page in Markdown."""
    whole = [t for t in tried if t.proposed is not None and t.random is not None]
    differ = [t for t in whole if t.proposed.design != t.random.design]  # type: ignore[union-attr]
    rows = [
        ("ambiguous cases tried, all simulated", f"{len(whole)} of {len(tried)}"),
        ("the proposed test left one explanation", _rate(whole, "proposed", _ended)),
        ("... and it is what was concealed", _rate(whole, "proposed", _right)),
        ("a random one of the same tests left one explanation", _rate(whole, "random", _ended)),
        ("... and it is what was concealed", _rate(whole, "random", _right)),
        ("cases in which both tests differ", str(len(differ))),
        ("of these: the proposed one left one explanation", _rate(differ, "proposed", _ended)),
        ("of these: the random one did", _rate(differ, "random", _ended)),
        ("chance that the plan reckoned for its proposal, mean", _mean(whole, "proposed")),
        ("for the random one, mean", _mean(whole, "random")),
    ]
    return "\n".join([markdown_table(["", ""], rows), _cases(tried)])


def _ended(outcome: Outcome) -> bool:
    return outcome.ended


def _right(outcome: Outcome) -> bool:
    return outcome.right


def _rate(tried: Sequence[Tried], which: str, holds: Callable[[Outcome], bool]) -> str:
    return str(Rate(sum(holds(getattr(t, which)) for t in tried), len(tried)))


def _mean(tried: Sequence[Tried], which: str) -> str:
    chances = [getattr(t, which).chance for t in tried]
    return f"{np.mean(chances):.0%}" if chances else "no case"


def _cases(tried: Sequence[Tried]) -> str:
    rows = [
        (str(t.number), " + ".join(t.concealed), _or(t.before), _told(t.proposed, t.why), _told(t.random, ""))
        for t in tried
    ]
    return markdown_table(["case", "concealed", "open before", "proposed", "random"], rows)


def _told(outcome: Outcome | None, why: str) -> str:
    if outcome is None:
        return why
    mark = " (right)" if outcome.right else ""
    left = _or(outcome.models) if outcome.models else ""
    return f"{outcome.design} ({outcome.chance:.0%}): {outcome.verdict} {left}{mark}".strip()


def _or(models: Sequence[Sequence[str]]) -> str:
    return " or ".join(" + ".join(names) for names in models)

"""What to measure next, and how a diagnosis is told of it."""

from __future__ import annotations

from collections.abc import Sequence

from legfem.inverse.mechanism import null_of
from legfem.inverse.verdict import Diagnosis
from legfem.report.diagnosis_sentences import next_experiments
from legfem.report.web import page as web
from legfem.report.web.diagnosis_headline import capital


def next_blocks(found: Diagnosis, plan: Sequence[str]) -> list[web.Block]:
    """Return what to measure next.

    Parameters
    ----------
    found
        The diagnosis.
    plan
        What was reckoned, each with its chance, the best first.
    """
    wanted = [capital(line) for line in next_experiments(found)]
    if plan:
        told = [capital(line) for line in plan]
        left = [line for line in wanted if not any(line in one for one in told)]
        blocks: list[web.Block] = [web.Prose("Reckoned under each candidate, the best first:"), web.Bullets(told)]
        if left:
            blocks += [web.Prose("Not reckoned:"), web.Bullets(left)]
        how = _to_state(found)
        return [*blocks, how] if how.rows else blocks
    if not wanted:
        return [web.Prose("Nothing is asked for by these recordings: use the stiffness with the law it belongs to.")]
    why = {"ambiguous": "To tell the candidates apart:", "named": "To confirm what was named:"}
    before = [web.Prose(why[found.verdict])] if found.verdict in why else []
    return [*before, web.Bullets(wanted)]


def _to_state(found: Diagnosis) -> web.WebTable:
    """Return how to tell a diagnosis of effects that were measured by themselves."""
    asked = dict.fromkeys(m for model in found.models for m in model.fit.mechanisms)
    return web.WebTable(
        "An effect measured by itself goes into subject.toml, a [[measured]] for each with its "
        "value, sd and source; then diagnose again",
        ["effect =", "value =", "unit", "value without it"],
        [
            [f'"{m.name}"', f"{first.name.replace('_', ' ')}, {first.statement}", first.unit, f"{null_of(first):g}"]
            for m in asked
            for first in m.parameters[:1]
            if m.measured_sd is not None
        ],
    )

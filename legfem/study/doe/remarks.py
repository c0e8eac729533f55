"""What has to be said of a study's runs and of its leg."""

from __future__ import annotations

from collections.abc import Sequence

from legfem.mechanics.materials import Hyperelastic
from legfem.study.doe.factors import PARAMETERS, UNITS, Factor
from legfem.study.doe.study import StudyResult


def stopped_short(result: StudyResult) -> str:
    """Return which runs stopped short, else nothing."""
    if not result.failed:
        return ""
    runs = ", ".join(map(str, result.failed))
    return (
        f"{len(result.failed)} of {len(result.records)} runs stopped short (run {runs}): "
        "the analysis is of what there is"
    )


def run_notes(result: StudyResult) -> list[str]:
    """Return how many runs reach their depth, and what follows where some don't."""
    total, failed = len(result.records), result.failed
    lines = [f"{total - len(failed)} of {total} runs reach {result.definition.depth:g} mm."]
    for number in failed:
        record = result.records[number - 1]
        lines.append(f"Run {number} stops at {record.reached:.2f} mm: {record.reason}.")
    for analysis in result.analyses:
        if analysis.surface.missing:
            runs = ", ".join(map(str, analysis.surface.missing))
            lines.append(
                f"{analysis.metric.label} is analysed without run {runs}: fewer degrees of "
                "freedom, and the coefficients are no longer independent of each other."
            )
    soft = sum(record.contact_stiffness_factor < 1 for record in result.records)
    return [*lines, f"{soft} runs needed a softer contact law to go on."] if soft else lines


def fascia_note(result: StudyResult) -> str:
    """Return a remark where the fascia's Poisson's ratio is negative, else nothing."""
    given = result.subject.tissues["fascia"]
    levels = _levels(result.definition.factors, "fascia.C10") or [
        result.definition.fixed.get("fascia.C10", given.C10 or 0.0)
    ]
    ratios = [Hyperelastic(level, given.D1).poisson_ratio for level in levels]
    if min(ratios) >= 0:
        return ""
    span = f"{min(ratios):.2f}" if len(ratios) == 1 else f"{max(ratios):.2f} to {min(ratios):.2f}"
    return (
        f"The fascia's Poisson's ratio is {span}: it follows from the C10 and the D1 of "
        f"{given.D1:g}/MPa that the paper gives, which make its bulk modulus the smaller one."
    )


def _levels(factors: Sequence[Factor], name: str) -> list[float]:
    return [value * UNITS[PARAMETERS[name]][f.unit] for f in factors if f.name == name for value in (f.low, f.high)]

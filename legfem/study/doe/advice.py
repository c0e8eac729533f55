"""What follows from a study for who wants to test a leg."""

from __future__ import annotations

import numpy as np

from legfem.report.estimates import words_of
from legfem.study.doe.factors import OF_THE_GEOMETRY, Factor, label_of
from legfem.study.doe.information import IDENTIFIED, IDENTIFIED_WITHIN
from legfem.study.doe.metrics import Metric
from legfem.study.doe.study import MetricAnalysis, StudyResult

_UNSEEN = 0.01
"""Share of a metric's variation below which a factor doesn't show."""


def shares(analysis: MetricAnalysis) -> tuple[dict[str, float], float]:
    """Return what the factors make of a metric's variation, by symbol, and what interactions make.

    Squares of the coded coefficients over their sum: the sums of squares of an orthogonal design.
    """
    squares = {test.term: test.value**2 for test in analysis.tests[1:]}
    total = sum(squares.values()) or 1.0
    main = {test.term: squares[test.term] / total for test in analysis.main()}
    return main, 1.0 - sum(main.values())


def largest_share(result: StudyResult) -> tuple[Factor, float, Metric]:
    """Return the factor that makes most of the last metric: the slope in the deepest window."""
    analysis = result.analyses[-1]
    main, _ = shares(analysis)
    factor = max(result.definition.factors, key=lambda one: main[one.symbol])
    return factor, main[factor.symbol], analysis.metric


def in_words(factor: Factor) -> str:
    """Return a factor for a sentence."""
    if factor.name in OF_THE_GEOMETRY:
        return f"the {factor.label}"
    return words_of(factor.name)


def not_seen(result: StudyResult) -> list[str]:
    """Return the factors whose shares are small in every metric."""
    every = [shares(analysis)[0] for analysis in result.analyses]
    return [
        factor.label for factor in result.definition.factors if all(main[factor.symbol] < _UNSEEN for main in every)
    ]


def to_know(result: StudyResult) -> str:
    """Return which assumed parameter moves the identified ones most."""
    ranked = _biases(result)
    if not ranked:
        return "Not computed: run it without --factorial-only."
    name, errors = ranked[0]
    moved = " and ".join(f"{label_of(one)} {10 * error:+.0f} %" for one, error in zip(IDENTIFIED, errors, strict=True))
    return f"Before all {label_of(name)}: taken 10 % too high, it moves {moved}."


def to_measure(result: StudyResult) -> list[str]:
    """Return what to measure, in sentences, the most important first."""
    information, depth = result.information, result.definition.depth
    ranked = _biases(result)
    if information is None or not ranked:
        return ["Run it without --factorial-only: then it says how well each parameter can be known."]
    lines = []
    within = [
        1.96 * information.relative_sd(depth, within_ranges=True)[information.names.index(name)] for name in IDENTIFIED
    ]
    told = all(half <= IDENTIFIED_WITHIN for half in within)
    halves = " and ".join(
        f"{label_of(name)} within {_percent(half)}" for name, half in zip(IDENTIFIED, within, strict=True)
    )
    if told:
        lines.append(
            f"Press {depth:g} mm deep: with fat and fascia known within their ranges, one trial tells {halves}."
        )
    else:
        lines.append(
            f"A press of {depth:g} mm alone isn't enough: with fat and fascia known within their "
            f"ranges only, it tells {halves}. Measure {label_of(ranked[0][0])} by another test."
        )
    depths = {name: information.told_from(name, within_ranges=True) for name in information.names}
    lines += [
        f"{label_of(name)} is told within 50 % from {at:g} mm on."
        if at is not None
        else f"{label_of(name)} is never told within 50 % with fat and fascia known within their "
        "ranges only: don't identify it from this test alone."
        for name, at in depths.items()
        if name in IDENTIFIED
    ]
    lines.append(
        "In the order of what errors in them do: know " + ", ".join(label_of(name) for name, _ in ranked) + "."
    )
    return lines


def _biases(result: StudyResult) -> list[tuple[str, list[float]]]:
    """Return what an assumed parameter's error does to both identified, the largest first."""
    found = result.information
    if found is None or not set(IDENTIFIED) <= set(found.names):
        return []
    try:
        each = [
            (name, [float(e) for e in found.bias(result.definition.depth, IDENTIFIED, name)])
            for name in found.names
            if name not in IDENTIFIED
        ]
    except np.linalg.LinAlgError:
        return []
    return sorted(each, key=lambda pair: -max(map(abs, pair[1])))


def _percent(half: float) -> str:
    return f"{100 * half:.0f} %" if half < 10 else "over 1000 %"

"""The study's pages: what all scored cases say together, and case by case."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from legfem.common.documents import json_types, markdown_table
from legfem.report.style import FAINT, new_figure, panel, styled
from studies.concealed.forms import FORMS, OUTSIDE
from studies.concealed.scoring import VISIBLE, Explained, Reliability, Scored, at_base_rates, reliability_of
from studies.lab.outcomes import Rate

KINDS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("alone", ("single",)),
    ("in pairs", ("pair",)),
    ("all", ("single", "pair")),
)
"""Of effects, in words and by what their cases are judged as."""
ASKED: tuple[tuple[str, Callable[[Scored, Explained], bool]], ...] = (
    ("all that is concealed", Scored.is_truth),
    ("what shows", Scored.is_what_shows),
)
SIZES = (0.0, 2.0, 4.0, 8.0, 16.0, np.inf)


@dataclass(frozen=True)
class Named:
    """How many of some visible effects were named."""

    effects: str
    """Which ones, in words."""
    asked: str
    """What of them has to be named, in words."""
    first: Rate
    """Named first."""
    in_set: Rate
    """Among the explanations that hold 90 %."""
    in_said: Rate
    """Among the statements of the report that do."""

    @classmethod
    def of(
        cls, effects: str, asked: str, scored: Sequence[Scored], right: Callable[[Scored, Explained], bool]
    ) -> Named:
        """Return the counts of scored cases, by which explanations are right."""
        return cls(
            effects,
            asked,
            _rate(scored, lambda s: any(right(s, e) for e in s.named_first)),
            _rate(scored, lambda s: any(right(s, e) for e in s.set_of_90)),
            _rate(scored, lambda s: any(right(s, e) for e in s.said_of_90)),
        )


@dataclass(frozen=True)
class Summary:
    """What all cases say together; twins count for stability alone."""

    named: tuple[Named, ...]
    """Of visible effects, by `KINDS` and by `ASKED`."""
    median_set: float
    """Explanations that hold 90 % together."""
    median_said: float
    """Statements of the report that do."""
    false_alarms: Rate
    outside: Rate
    """Visible ones that are called unexplained."""
    covered: Rate
    """Of all cases, wrong names included."""
    f1: float
    bias_before: float
    """Median of C10's absolute relative error where an effect is concealed."""
    bias_after: float
    same_answer: Rate
    """Of twins: the same first name, or each one's first among the other's."""
    reliability: tuple[Reliability, ...]
    """Of what the report says first, with the probability that it states."""
    reliability_shows: tuple[Reliability, ...]
    """The same, right where it has all that should be seen."""
    at_base_rates: tuple[Reliability, ...]
    """Of those that are first with the study's own shares for priors: the evidence's part of it."""
    nothing_shows: tuple[Reliability, ...]
    """Of the statement that nothing shows, which is right of effects that are too small to see."""
    by_leg: tuple[tuple[int, Rate, float], ...]
    """Legs, how often C10's interval holds the truth, and the median error of C10: how a leg is
    stated wrongly is the same in all of its cases."""
    by_size: tuple[tuple[float, float, Rate, Rate], ...]
    """Sizes over all errors, named first, and in the set."""
    by_apart: tuple[tuple[float, float, Rate, Rate], ...]
    """Of visible effects that come alone, the same by their size beside the nearest mechanism but
    their own."""


def summarise(everything: Sequence[Scored]) -> Summary:
    """Return the summary of scored cases."""
    scored = [s for s in everything if s.case.twin_of is None]
    known = {s.case.number: s for s in scored}
    twins = [(s, known[s.case.twin_of]) for s in everything if s.case.twin_of in known]
    inside = [s for s in scored if s.case.judged in ("single", "pair")]
    seen = [s for s in inside if s.visible]
    none = [s for s in scored if s.case.kind == "none"]
    outside = [s for s in scored if s.case.judged == "outside" and s.visible]
    hit, wrong, missed = np.sum([s.located for s in [*seen, *outside]] or [(0, 0, 0)], axis=0)
    return Summary(
        tuple(
            Named.of(effects, asked, [s for s in seen if s.case.judged in kinds], right)
            for effects, kinds in KINDS
            for asked, right in ASKED
        ),
        _median([len(s.set_of_90) for s in seen]),
        _median([len(s.said_of_90) for s in seen]),
        _rate(none, lambda s: s.verdict != "consistent"),
        _rate(outside, lambda s: s.first),
        _rate(scored, lambda s: s.covered),
        float(2 * hit / max(2 * hit + wrong + missed, 1)),
        _median([abs(s.bias_before) for s in inside]),
        _median([abs(s.bias_after) for s in inside]),
        Rate(sum(_agree(a, b) for a, b in twins), len(twins)),
        reliability(scored),
        reliability_of([(s.said[0].probability, s.says_what_shows(s.said[0])) for s in scored]),
        reliability_of([_first_at_base_rates(s) for s in scored]),
        reliability_of([(s.nothing_shows, not s.visible) for s in scored]),
        tuple(
            (leg, _rate(mine, lambda s: s.covered), float(np.median([s.bias_after for s in mine])))
            for leg in sorted({s.case.leg for s in scored})
            for mine in [[s for s in scored if s.case.leg == leg]]
        ),
        _by_size(inside, lambda s: s.size),
        _by_size([s for s in seen if s.case.judged == "single"], lambda s: s.apart),
    )


def _by_size(scored: Sequence[Scored], size: Callable[[Scored], float]) -> tuple[tuple[float, float, Rate, Rate], ...]:
    """Return bounds of sizes, and of the cases between them how many are named, and listed."""
    return tuple(
        (low, high, _rate(mine, lambda s: s.first), _rate(mine, lambda s: s.in_set))
        for low, high in pairwise(SIZES)
        for mine in [[s for s in scored if low <= size(s) < high]]
    )


def reliability(scored: Sequence[Scored]) -> tuple[Reliability, ...]:
    """Return how often what the report says first is right, by the probability it states."""
    return reliability_of([(s.said[0].probability, s.says_true(s.said[0])) for s in scored])


def _first_at_base_rates(s: Scored) -> tuple[float, bool]:
    shares, place = at_base_rates(s.explanations)
    return float(shares[place]), s.is_truth(s.explanations[place])


def _rate(scored: Sequence[Scored], holds: Callable[[Scored], bool]) -> Rate:
    return Rate(sum(holds(s) for s in scored), len(scored))


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if values else float("nan")


def _agree(one: Scored, other: Scored) -> bool:
    """Tell whether twins have the same first name, or a tie that both say."""
    if not one.models or not other.models:
        return one.verdict == other.verdict
    sets = [[frozenset(model) for model in s.models] for s in (one, other)]
    return sets[0][0] in sets[1] and sets[1][0] in sets[0]


SCHEMA = 3


def scored_document(scored: Sequence[Scored], summary: Summary) -> dict[str, Any]:
    """Return the scores as JSON types."""
    return {
        "schema": SCHEMA,
        "origin": "simulated",
        "summary": json_types(asdict(summary)),
        "cases": [json_types(asdict(case)) for case in scored],
    }


def page(everything: Sequence[Scored], summary: Summary) -> str:
    """Return the page in Markdown; twins count for stability alone."""
    scored = [s for s in everything if s.case.twin_of is None]
    parts = [
        _summary(scored, summary),
        _named(summary),
        _sizes(summary),
        _reliability(summary),
        _legs(summary),
        _confusion(scored),
    ]
    return "\n".join(parts)


def _summary(scored: Sequence[Scored], summary: Summary) -> str:
    seconds = sorted(s.seconds for s in scored)
    codes = Counter(s.case.code for s in scored)
    rows = [
        ("cases, all simulated", f"{len(scored)}, {codes['felupe']} of them solved by felupe"),
        (
            "median number of explanations that hold 90 %; of the report's statements",
            f"{summary.median_set:g}; {summary.median_said:g}",
        ),
        ("false alarms without effect", str(summary.false_alarms)),
        ("effects outside the library: unexplained", str(summary.outside)),
        ("C10 within its 95 % interval, all cases", str(summary.covered)),
        (
            "median error of C10 with an effect: base model, after",
            f"{summary.bias_before:.1%}, {summary.bias_after:.1%}",
        ),
        ("localisation F1", f"{summary.f1:.2f}"),
        ("twins: the same first name, or a tie said", str(summary.same_answer)),
        ("processor seconds a diagnosis, median and longest", f"{seconds[len(seconds) // 2]:.0f}, {seconds[-1]:.0f}"),
    ]
    return markdown_table(["", ""], rows)


def _named(summary: Summary) -> str:
    rows = [[one.effects, one.asked, *map(str, (one.first, one.in_set, one.in_said))] for one in summary.named]
    header = [
        f"effects of the library, size {VISIBLE:g} or more",
        "asked",
        "named first",
        "in the explanations' 90 %",
        "in the statements' 90 %",
    ]
    return markdown_table(header, rows)


def _sizes(summary: Summary) -> str:
    tables = (
        ("size over all errors", summary.by_size),
        ("alone, size 4 or more: size beside the nearest other mechanism", summary.by_apart),
    )
    return "\n".join(
        markdown_table(
            [title, "named first", "in the 90 % set"],
            [[f"{low:g} to {high:g}", str(first), str(in_set)] for low, high, first, in_set in of],
        )
        for title, of in tables
    )


def _reliability(summary: Summary) -> str:
    tables = (
        ("probability of what the report says first: all that is concealed", summary.reliability),
        ("the same: what shows", summary.reliability_shows),
        ("the same with the study's own shares for priors", summary.at_base_rates),
        ("probability that nothing shows; right below size 4", summary.nothing_shows),
    )
    return "\n".join(_reliability_table(title, found) for title, found in tables)


def _reliability_table(title: str, found: Sequence[Reliability]) -> str:
    rows = [
        [f"{one.low:g} to {one.high:g}", "" if not one.right.total else f"{one.stated:.2f}", str(one.right)]
        for one in found
    ]
    return markdown_table([title, "mean", "right"], rows)


def _legs(summary: Summary) -> str:
    rows = [[f"{leg}", str(rate), f"{error:+.1%}"] for leg, rate, error in summary.by_leg]
    return markdown_table(["leg", "C10 within its interval", "median error of C10"], rows)


def _confusion(scored: Sequence[Scored]) -> str:
    rows = []
    for truth in sorted({truth_of(s) for s in scored}):
        mine = [s for s in scored if truth_of(s) == truth]
        called = Counter(_called(s) for s in mine)
        counts = (
            len(mine),
            sum(s.visible for s in mine),
            sum(s.first for s in mine),
            sum(s.in_set for s in mine),
            sum(s.first_shows for s in mine),
            sum(s.in_said for s in mine),
        )
        names = ", ".join(f"{name}: {count}" for name, count in called.most_common())
        rows.append([truth, _form(mine[0]), *map(str, counts), names])
    header = [
        "concealed",
        "form",
        "cases",
        "visible",
        "named first",
        "in the 90 % set",
        "what shows: first",
        "said",
        "called",
    ]
    return markdown_table(header, rows)


def cases_page(everything: Sequence[Scored]) -> str:
    """Return the list of cases in Markdown; twins stand beside the case that they repeat."""
    scored = [s for s in everything if s.case.twin_of is None]
    again = {s.case.twin_of: s for s in everything if s.case.twin_of is not None}
    rows = []
    for s in scored:
        case = s.case
        rows.append(
            [
                f"{case.number}",
                f"{case.leg}, {case.protocol}, {case.code}",
                truth_of(s),
                f"{s.share:.1%}, {_sizes_of(s)}",
                _verdict(s),
                _verdict(again.get(case.number)),
                f"{s.bias_before:+.1%}, {s.bias_after:+.1%}",
                "yes" if s.covered else "no",
                "yes" if s.first else "in the set" if s.in_set else "no",
            ]
        )
    header = [
        "case",
        "leg, protocol, code",
        "concealed",
        "share of the force, size (each beside the other)",
        "verdict",
        "with other noise",
        "C10 error before, after",
        "in its interval",
        "right",
    ]
    return markdown_table(header, rows)


@styled
def figure(everything: Sequence[Scored], summary: Summary) -> Figure:
    """Return the reliability diagram, and the scores by an effect's size over all errors."""
    drawn = new_figure(9.0, 3.8)
    left, right = drawn.subplots(1, 2)
    left.plot([0, 1], [0, 1], color=FAINT, lw=1)
    for one in summary.reliability:
        if one.right.total:
            low, high = one.right.interval
            share = one.right.share
            left.errorbar(one.stated, share, [[share - low], [high - share]], fmt="o", color="#0072B2", capsize=3)
            left.annotate(f"{one.right.total}", (one.stated, share), (5, -11), textcoords="offset points", fontsize=8)
    left.set(xlim=(0, 1), ylim=(0, 1.02), xlabel="probability of what is said first", ylabel="share that is right")
    panel(left, "a", "are probabilities true?")
    inside = [s for s in everything if s.case.judged in ("single", "pair")]
    for level, (label, colour, holds) in enumerate(
        (
            ("named first", "#0072B2", [s.first for s in inside]),
            ("in the 90 % set only", "#E69F00", [s.in_set and not s.first for s in inside]),
            ("neither", "#D55E00", [not (s.in_set or s.first) for s in inside]),
        )
    ):
        sizes = [max(s.size, 0.3) for s, yes in zip(inside, holds, strict=True) if yes]
        spread = np.linspace(-0.25, 0.25, len(sizes)) if len(sizes) > 1 else np.zeros(len(sizes))
        right.plot(sizes, level + spread, "o", ms=4, color=colour)
        right.text(0.02, level + 0.3, label, transform=right.get_yaxis_transform(), fontsize=9)
    right.axvline(VISIBLE, color=FAINT, lw=1)
    right.set(
        xscale="log", yticks=[], ylim=(-0.5, 2.6), xlabel="size of the effect over all errors (standard deviations)"
    )
    panel(right, "b", "what is named")
    drawn.suptitle("Sealed cases: simulated data", x=0.01, ha="left", fontsize=12)
    return drawn


def _sizes_of(s: Scored) -> str:
    sizes = dict(s.parts)
    each = ", ".join(f"{sizes[name]:.1f}" for name in s.case.names if name in sizes)
    return f"{s.size:.1f} ({each})" if each else f"{s.size:.1f}"


def truth_of(s: Scored) -> str:
    """Return what a case conceals, in words."""
    if s.case.kind == "none":
        return "nothing"
    if s.case.judged == "outside":
        return "outside: " + " + ".join(name for name, _ in s.case.outside)
    return " + ".join(s.case.names)


def _form(s: Scored) -> str:
    forms = [FORMS[name].statement for name, _ in s.case.effects]
    return "; ".join([*forms, *(OUTSIDE[name] for name, _ in s.case.outside)]) or "-"


def _called(s: Scored) -> str:
    return " or ".join(" + ".join(model) for model in s.models) or s.verdict


def _verdict(s: Scored | None) -> str:
    if s is None:
        return ""
    return f"{s.verdict}: {_called(s)}" if s.models else s.verdict

"""What all scored cases say together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from studies.concealed.reliability import Explained, Reliability, at_base_rates, reliability_of
from studies.concealed.scoring import Scored
from studies.lab.rate import Rate

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

"""Opening the keys, and what the diagnoses were worth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from legfem.common.errors import InputError
from legfem.diagnose.run import Diagnoser
from studies.concealed.cases import SealedCase
from studies.concealed.making import change_at
from studies.concealed.reliability import (
    Explained,
    Reliability,
    at_base_rates,
    reliability_of,
)
from studies.concealed.running import Metric, asked, case_folders, diagnoses, metric_file
from studies.concealed.seal import read_sealed
from studies.lab.rate import Rate

VISIBLE = 4.0
"""Size of an effect over all errors from which it should be seen.

A known shape of this size gains 8 in the logarithm of the evidence; one mechanism of sixteen costs
3 by its prior and some 2 by its strength's, and noise moves the gain by 4 either way.
"""
SIZES = (0.0, 2.0, 4.0, 8.0, 16.0, np.inf)
HELD = 0.9


@dataclass(frozen=True)
class Scored:
    """One case with its diagnosis."""

    case: SealedCase
    verdict: str
    models: tuple[tuple[str, ...], ...]
    """Named models' mechanisms, the first the best."""
    explanations: tuple[Explained, ...]
    """The most probable first."""
    size: float
    """Of the concealed effects over all errors; see `Metric.shown`."""
    share: float
    """Greatest change by the effects, over the greatest force."""
    located: tuple[int, int, int]
    """Observations marked rightly, marked wrongly, missed."""
    bias_before: float
    """Relative error of C10 by the base model."""
    bias_after: float
    covered: bool
    """Whether C10's 95 % interval over all explanations holds the truth."""
    seconds: float
    """Of a processor."""
    full_solutions: int
    nothing_shows: float
    """Probability that nothing was left out that shows."""
    said: tuple[Explained, ...]
    """What the report says, the most probable first; without names, that nothing shows."""

    @property
    def visible(self) -> bool:
        """Whether the effect should be seen."""
        return self.size >= VISIBLE

    @property
    def set_of_90(self) -> tuple[Explained, ...]:
        """The most probable explanations that hold 90 % together."""
        kept, held = [], 0.0
        for one in self.explanations:
            kept.append(one)
            held += one.probability
            if held >= HELD:
                break
        return tuple(kept)

    def is_truth(self, one: Explained) -> bool:
        """Tell whether an explanation is what was concealed."""
        if self.case.judged == "outside":
            return one.unknown
        return not one.unknown and set(one.names) == set(self.case.names)

    def says_true(self, one: Explained) -> bool:
        """Tell whether a statement is true: that nothing shows, of effects too small to see."""
        if not one.names and not one.unknown:
            return not self.visible
        return self.is_truth(one)

    @property
    def first(self) -> bool:
        """Whether the most probable explanation that is left once nothing is ruled out is right.

        Of a case without effect: whether it is called consistent.
        """
        if self.case.kind == "none":
            return self.verdict == "consistent"
        if self.case.judged == "outside":
            return self.verdict == "unexplained"
        return bool(self.models) and set(self.models[0]) == set(self.case.names)

    @property
    def in_set(self) -> bool:
        """Whether the truth is among the explanations that hold 90 %."""
        return any(self.is_truth(one) for one in self.set_of_90)


def score_cases(out: Path, seed: int, diagnoser: Diagnoser) -> list[Scored]:
    """Open the key of every case that was diagnosed, and compare.

    Raises
    ------
    InputError
        If a key doesn't open, or there are no cases or diagnoses.
    """
    scored = []
    store = diagnoses(out, diagnoser)
    for folder in case_folders(out):
        key = read_sealed(out / "keys" / f"{folder.name}.json", seed)
        found = store.get(asked(folder))
        if found is not None:
            scored.append(_scored(found, key, Metric.read(metric_file(out, folder))))
    if not scored:
        raise InputError(store.folder, "*.json", "none is of these cases by this code", "add --run")
    return scored


def _scored(found: dict[str, Any], key: dict[str, Any], metric: Metric) -> Scored:
    case = SealedCase.of(key["case"])
    change = np.zeros(len(metric.time))
    for k in range(int(metric.trial.max()) + 1):
        here = metric.trial == k
        change[here] = change_at(key, k, metric.time[here])
    size, rest = metric.shown(change)
    wrong = np.abs(rest) > metric.trial_sd
    before, after = (found[f"parameters_{when}"]["c10_deep"] for when in ("before", "after"))
    low, high = after["ci95"]
    return Scored(
        case,
        found["verdict"],
        tuple(tuple(model["mechanisms"]) for model in found["models"]),
        tuple(
            Explained(tuple(e["mechanisms"]), bool(e["unknown"]), float(e["probability"]))
            for e in found["explanations"]
        ),
        size,
        float(np.abs(change).max()) / key["greatest_force_N"],
        _overlap(metric.located, wrong),
        before["value"] / case.c10_kpa - 1.0,
        after["value"] / case.c10_kpa - 1.0,
        bool(low <= case.c10_kpa <= high),
        found["processor_s"],
        found["full_solutions"],
        found["probability_that_nothing_shows"],
        tuple(
            Explained(tuple(s["mechanisms"]), bool(s["unknown"]), float(s["probability"]))
            for s in found["statements"]
        ),
    )


def _overlap(said: Any, true: Any) -> tuple[int, int, int]:
    return int((said & true).sum()), int((said & ~true).sum()), int((~said & true).sum())


@dataclass(frozen=True)
class Summary:
    """What all cases say together; twins count for stability alone."""

    first: Rate
    """Of visible single effects and pairs."""
    in_set: Rate
    median_set: float
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
    at_base_rates: tuple[Reliability, ...]
    """Of those that are first with the study's own shares for priors: the evidence's part of it."""
    nothing_shows: tuple[Reliability, ...]
    """Of the statement that nothing shows, which is right of effects that are too small to see."""
    by_leg: tuple[tuple[int, Rate, float], ...]
    """Legs, how often C10's interval holds the truth, and the median error of C10: how a leg is
    stated wrongly is the same in all of its cases."""
    by_size: tuple[tuple[float, float, Rate, Rate], ...]
    """Sizes over all errors, named first, and in the set."""


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
        _rate(seen, lambda s: s.first),
        _rate(seen, lambda s: s.in_set),
        float(np.median([len(s.set_of_90) for s in seen])) if seen else float("nan"),
        _rate(none, lambda s: s.verdict != "consistent"),
        _rate(outside, lambda s: s.first),
        _rate(scored, lambda s: s.covered),
        float(2 * hit / max(2 * hit + wrong + missed, 1)),
        _median([abs(s.bias_before) for s in inside]),
        _median([abs(s.bias_after) for s in inside]),
        Rate(sum(_agree(a, b) for a, b in twins), len(twins)),
        reliability(scored),
        reliability_of([_first_at_base_rates(s) for s in scored]),
        reliability_of([(s.nothing_shows, not s.visible) for s in scored]),
        tuple(
            (leg, _rate(mine, lambda s: s.covered), float(np.median([s.bias_after for s in mine])))
            for leg in sorted({s.case.leg for s in scored})
            for mine in [[s for s in scored if s.case.leg == leg]]
        ),
        tuple(
            (low, high, _rate(mine, lambda s: s.first), _rate(mine, lambda s: s.in_set))
            for low, high in pairwise(SIZES)
            for mine in [[s for s in inside if low <= s.size < high]]
        ),
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

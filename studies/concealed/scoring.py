"""Opening the keys, what the diagnoses were worth, and whether their probabilities are true."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.inverse.explain import PRIOR_NONE, PRIOR_PAIR, PRIOR_SINGLE, PRIOR_UNKNOWN
from legfem.legs.diagnosis import Diagnoser
from legfem.legs.loading import load_subject
from studies.concealed.cases import SHARES, SealedCase
from studies.concealed.diagnosing import Metric, asked, case_folders, diagnoses, metric_file
from studies.concealed.forms import NAMED, OUTSIDE
from studies.concealed.making import change_at_stations, read_sealed
from studies.lab.outcomes import Rate

BINS = (0.0, 0.4, 0.6, 0.8, 1.0)
_HAVE_A_NAME = SHARES["outside"] * len(NAMED) / len(OUTSIDE)
"""Effects outside the library's forms that are one of its mechanisms all the same."""


@dataclass(frozen=True)
class Explained:
    """One explanation that a diagnosis weighs."""

    names: tuple[str, ...]
    unknown: bool
    probability: float

    @property
    def nothing_shows(self) -> bool:
        """Whether it is that nothing was left out, or nothing that shows."""
        return not self.names and not self.unknown

    @property
    def base_rate(self) -> float:
        """How often the study conceals such a thing, over how often the diagnosis expects it."""
        if self.unknown:
            return (SHARES["outside"] - _HAVE_A_NAME) / PRIOR_UNKNOWN
        rates = (
            SHARES["none"] / PRIOR_NONE,
            (SHARES["single"] + _HAVE_A_NAME) / PRIOR_SINGLE,
            SHARES["pair"] / PRIOR_PAIR,
        )
        return rates[len(self.names)]


@dataclass(frozen=True)
class Reliability:
    """Statements of like probability: how often they are right."""

    low: float
    high: float
    stated: float
    """Mean of their probabilities; NaN of nothing."""
    right: Rate


def reliability_of(statements: Sequence[tuple[float, bool]]) -> tuple[Reliability, ...]:
    """Return how often statements are right, by the probabilities that they are made with."""
    found = []
    for low, high in pairwise(BINS):
        mine = [(p, right) for p, right in statements if low < min(p, 1.0) <= high]
        mean = float(np.mean([p for p, _ in mine])) if mine else float("nan")
        found.append(Reliability(low, high, mean, Rate(sum(right for _, right in mine), len(mine))))
    return tuple(found)


def at_base_rates(explanations: Sequence[Explained]) -> tuple[FloatArray, int]:
    """Return probabilities with the study's shares for priors, and the place of the largest."""
    weights = np.array([e.probability * e.base_rate for e in explanations])
    weights /= weights.sum()
    return weights, int(np.argmax(weights))


VISIBLE = 4.0
"""Size of an effect over all errors from which it should be seen.

A known shape of this size gains 8 in the logarithm of the evidence; one mechanism of sixteen costs
3 by its prior and some 2 by its strength's, and noise moves the gain by 4 either way.
"""
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
    """Of the concealed effects over all errors; see `Metric.size`."""
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
    parts: tuple[tuple[str, float], ...] = ()
    """Of two effects: each one's name, and its size beside the other; see `Metric.size`."""
    apart: float = float("nan")
    """Size beside the nearest mechanism but its own; see `Metric.told_apart`."""

    @property
    def visible(self) -> bool:
        """Whether the effect should be seen."""
        return self.size >= VISIBLE

    @property
    def shown(self) -> frozenset[str]:
        """Mechanisms that should be seen: of two effects those that the other can't stand for."""
        if len(self.case.names) < 2:
            return frozenset(self.case.names if self.visible else ())
        return frozenset(name for name, size in self.parts if size >= VISIBLE)

    @property
    def named_first(self) -> tuple[Explained, ...]:
        """What is named first, if anything is; sure of it."""
        return tuple(Explained(names, False, 1.0) for names in self.models[:1])

    @property
    def set_of_90(self) -> tuple[Explained, ...]:
        """The most probable explanations that hold 90 % together."""
        return _until_held(self.explanations)

    @property
    def said_of_90(self) -> tuple[Explained, ...]:
        """The most probable statements of the report that hold 90 % together."""
        return _until_held(self.said)

    def is_truth(self, one: Explained) -> bool:
        """Tell whether an explanation is what was concealed."""
        if self.case.judged == "outside":
            return one.unknown
        return not one.unknown and set(one.names) == set(self.case.names)

    def is_what_shows(self, one: Explained) -> bool:
        """Tell whether an explanation has all that should be seen, and nothing but the truth.

        Of two effects of which neither is seen beside the other either will do, or both.
        """
        if len(self.case.names) < 2 or not self.visible:
            return self.is_truth(one)
        names = frozenset(one.names)
        return bool(names) and self.shown <= names <= set(self.case.names)

    def says_true(self, one: Explained) -> bool:
        """Tell whether a statement is true: that nothing shows, of effects too small to see."""
        return not self.visible if one.nothing_shows else self.is_truth(one)

    def says_what_shows(self, one: Explained) -> bool:
        """Tell the same, with all that should be seen for the truth."""
        return not self.visible if one.nothing_shows else self.is_what_shows(one)

    @property
    def first(self) -> bool:
        """Whether the most probable explanation that is left once nothing is ruled out is right.

        Of a case without effect: whether it is called consistent.
        """
        if self.case.kind == "none":
            return self.verdict == "consistent"
        if self.case.judged == "outside":
            return self.verdict == "unexplained"
        return any(self.is_truth(one) for one in self.named_first)

    @property
    def in_set(self) -> bool:
        """Whether the truth is among the explanations that hold 90 %."""
        return any(self.is_truth(one) for one in self.set_of_90)

    @property
    def first_shows(self) -> bool:
        """Whether the model that is named first has what should be seen."""
        return self.first or any(self.is_what_shows(one) for one in self.named_first)

    @property
    def in_said(self) -> bool:
        """Whether what should be seen is among the statements that hold 90 %."""
        return any(self.says_what_shows(one) for one in self.said_of_90)


def _until_held(explanations: Sequence[Explained]) -> tuple[Explained, ...]:
    kept, held = [], 0.0
    for one in explanations:
        kept.append(one)
        held += one.probability
        if held >= HELD:
            break
    return tuple(kept)


@dataclass(frozen=True, eq=False)
class _Changes:
    """What concealed effects change of the observations (n,), N: all, and each of two by name."""

    whole: FloatArray
    parts: Mapping[str, FloatArray]


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
            changes = _changes(folder, key, diagnoser)
            scored.append(_scored(found, key, Metric.read(metric_file(out, folder)), changes))
    if not scored:
        raise InputError(store.folder, "*.json", "none is of these cases by this code", "add --run")
    return scored


def _changes(folder: Path, key: Mapping[str, Any], diagnoser: Diagnoser) -> _Changes:
    if "recorded_change_N" not in key:
        raise InputError(
            folder,
            "key",
            "was written by an earlier version",
            "take the folder of keys away and make the cases again: nothing is solved anew",
        )
    subject = load_subject(folder)
    observed = diagnoser.observations(subject)

    def at_stations(change: Sequence[Sequence[float]]) -> FloatArray:
        return change_at_stations(subject.recordings, change, observed)

    parts = key["recorded_part_change_N"]
    return _Changes(
        at_stations(key["recorded_change_N"]), {name: at_stations(change) for name, change in parts.items()}
    )


def _scored(found: dict[str, Any], key: dict[str, Any], metric: Metric, changes: _Changes) -> Scored:
    case, change = SealedCase.of(key["case"]), changes.whole
    size = metric.size(change)
    wrong = np.abs(metric.shown(change)) > metric.trial_sd
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
        before["value"] / case.true_c10_kpa - 1.0,
        after["value"] / case.true_c10_kpa - 1.0,
        bool(low <= case.true_c10_kpa <= high),
        found["processor_s"],
        found["full_solutions"],
        found["probability_that_nothing_shows"],
        tuple(
            Explained(tuple(s["mechanisms"]), bool(s["unknown"]), float(s["probability"])) for s in found["statements"]
        ),
        tuple((name, metric.size(change, change - part)) for name, part in changes.parts.items()),
        metric.told_apart(change, case.names),
    )


def _overlap(said: Any, true: Any) -> tuple[int, int, int]:
    return int((said & true).sum()), int((said & ~true).sum()), int((~said & true).sum())

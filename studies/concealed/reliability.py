"""Whether probabilities are true: what is stated beside what is right, in bins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.explain import PRIOR_NONE, PRIOR_PAIR, PRIOR_SINGLE, PRIOR_UNKNOWN
from studies.concealed.cases import SHARES
from studies.concealed.forms import NAMED, OUTSIDE
from studies.lab.rate import Rate

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

"""How explanations are weighed: what is expected before the recordings, times the evidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from legfem.diagnose.explanation import Explanation
from legfem.diagnose.mechanisms import Mechanism
from legfem.inverse.evidence import probabilities

PRIOR_NONE, PRIOR_SINGLE, PRIOR_PAIR, PRIOR_UNKNOWN = 0.37, 0.37, 0.18, 0.08
"""Of all explanations of a kind together: one effect is expected in a test, by Poisson's
distribution none, one or two; what is left is more than two, or what no mechanism describes."""


@dataclass(frozen=True)
class ExplanationPriors:
    """How probable mechanisms are before the recordings, alone and in pairs.

    Parameters
    ----------
    expected
        By name, how often each is there, over the others; see `Mechanism.expected`.
    """

    expected: Mapping[str, float]

    @classmethod
    def among(cls, mechanisms: Sequence[Mechanism]) -> ExplanationPriors:
        """Return the priors of the mechanisms that recordings can show."""
        return cls({m.name: m.expected for m in mechanisms})

    def log_of(self, *names: str) -> float:
        """Return the logarithm of the prior of one mechanism or of two."""
        each = np.array(list(self.expected.values()))
        own = np.prod([self.expected[name] for name in names])
        if len(names) == 1:
            return float(np.log(PRIOR_SINGLE * own / each.sum()))
        return float(np.log(PRIOR_PAIR * own / (0.5 * (each.sum() ** 2 - each @ each))))


def with_probabilities(found: Sequence[Explanation]) -> list[Explanation]:
    """Return explanations with their probabilities, the most probable first."""
    shares = probabilities([e.log_weight for e in found])
    each = [replace(e, probability=float(p)) for e, p in zip(found, shares, strict=True)]
    return sorted(each, key=lambda e: -e.probability)

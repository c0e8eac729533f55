r"""What an answer rests on: which responses are solved beyond those that screen every mechanism.

Screened, a mechanism's response is known at one stiffness and at a few strengths, and two act as the sum of both. What
that misses is a share of what the mechanism explains, so that the logarithm of its evidence may move by

.. math:: D = D_0 + s \max(\ln B, 0)

with its Bayes factor B over nothing; of two at once over the better one alone. What is probable is solved in full, and
then what could become so, until no D that is left moves a probability by `MATTERS`.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.special import expit, logit

from legfem.inverse.explanation import ADDS_FROM, MORE_THAN_ALONE, Explanation, better_of, log_bayes_factor, singles_of
from legfem.inverse.library import Detail, Library
from legfem.inverse.mechanism import TissueMechanism

MATTERS = 0.02
"""Of a probability."""
MISSED = 0.15
"""s, and ..."""
LEAST_MISSED, LEAST_MISSED_OF_TWO = 0.1, 1.5
"""... D_0 of one and of two at once: of sealed cases' evidence, solved in full and screened."""

type Complete = Callable[[Detail], Library]
"""Solves what a library lacks of a detail."""


def may_move(one: Explanation, found: Sequence[Explanation]) -> float:
    """Return by how much ln of the evidence of an explanation may move where what it rests on is solved in full."""
    least = LEAST_MISSED if len(one.names) == 1 else LEAST_MISSED_OF_TWO
    return least + MISSED * max(_beyond(one, found), 0.0)


def rests_on(found: Sequence[Explanation], detail: Detail) -> Detail:
    """Return the detail that a library needs for explanations, of which it has one: the same where nothing is open.

    Parameters
    ----------
    found
        All, with their probabilities.
    detail
        What is solved in full.
    """
    waiting = [(one, lacks) for one in found if one.names and (lacks := lacking(one, detail)) != Detail()]
    first = [lacks for one, lacks in waiting if one.probability >= MATTERS and _adds(one, found, 0.0)]
    further = (lacks for one, lacks in waiting if moves(one, found) >= MATTERS)
    for lacks in first or further:
        detail |= lacks
    return detail


def moves(one: Explanation, found: Sequence[Explanation]) -> float:
    """Return by how much its probability may move; nothing of what adds nothing either way."""
    more = may_move(one, found)
    if not _adds(one, found, more):
        return 0.0
    p = float(np.clip(one.probability, 1e-300, 1.0 - 1e-12))
    return float(max(expit(logit(p) + more) - p, p - expit(logit(p) - more)))


def _beyond(one: Explanation, found: Sequence[Explanation]) -> float:
    """Return ln of the Bayes factor over nothing, or over the better one of two alone."""
    best = better_of(one, singles_of(found))
    return log_bayes_factor(one, next(e for e in found if e.is_base) if best is one else best)


def _adds(one: Explanation, found: Sequence[Explanation], more: float) -> bool:
    return _beyond(one, found) + more > (ADDS_FROM if len(one.names) == 1 else MORE_THAN_ALONE)


def lacking(one: Explanation, detail: Detail) -> Detail:
    """Return what of an explanation's mechanisms isn't solved in full."""
    tabulated = [m.name for m in one.fit.mechanisms if isinstance(m, TissueMechanism)]
    whole = frozenset(tabulated) - detail.whole
    return Detail(whole, frozenset([frozenset(tabulated)] if len(tabulated) > 1 else []) - detail.pairs)

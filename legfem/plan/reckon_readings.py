"""What it is worth to measure effects by themselves, see `legfem.plan.reckon`.

A reading of an effect's strength is an observation of one of the explanations' parameters: the
strength that the recordings gave it, or its null where an explanation hasn't that effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, permutations

import numpy as np

from legfem.common.units import FloatArray
from legfem.diagnose.mechanisms.base import AssumedAccuracy, Mechanism, measured_strength, null_of
from legfem.plan.designs import Readings
from legfem.plan.reckon import Candidate, Reckoned, reckoned, told_apart

_WORTH = 0.1
"""Of a chance, by which a second reading has to better the first one's."""


def reckon_readings(
    mechanisms: Sequence[Mechanism], candidates: Sequence[Candidate], accuracy: AssumedAccuracy
) -> list[Reckoned]:
    """Return what it is worth to measure effects by themselves: each, and the best two if better.

    Parameters
    ----------
    mechanisms
        That are in doubt; those that can't be measured by themselves are passed over.
    candidates
        Explanations that are open.
    accuracy
        Of what is assumed of the leg.
    """
    able = [m for m in mechanisms if m.measured_sd is not None]
    single = [_worth((m,), candidates, accuracy) for m in able]
    double = [_worth(pair, candidates, accuracy) for pair in combinations(able, 2)]
    best = max((one.chance for one in single), default=0.0)
    most = max(double, key=lambda one: one.chance, default=None)
    return [*single, most] if most is not None and most.chance > best + _WORTH else single


def _worth(mechanisms: tuple[Mechanism, ...], candidates: Sequence[Candidate], accuracy: AssumedAccuracy) -> Reckoned:
    errors = np.diag([_error(m, accuracy) ** 2 for m in mechanisms])
    means, spreads = zip(*(_strengths(c, mechanisms) for c in candidates), strict=True)
    chances = {
        (one.name, other.name): told_apart(means[i] - means[j], errors + spreads[j])
        for (i, one), (j, other) in permutations(enumerate(candidates), 2)
    }
    return reckoned(Readings(mechanisms), chances, candidates)


def _error(mechanism: Mechanism, accuracy: AssumedAccuracy) -> float:
    """Return a reading's standard deviation, over that of what is known beforehand."""
    assert mechanism.measured_sd is not None
    null = null_of(mechanism.parameters[0])
    return measured_strength(mechanism, null, mechanism.measured_sd, accuracy).sd


def _strengths(candidate: Candidate, mechanisms: Sequence[Mechanism]) -> tuple[FloatArray, FloatArray]:
    """Return mean (k,) and covariance (k, k) of departures: none of effects that it hasn't."""
    free = candidate.fit.free
    pick = np.zeros((len(mechanisms), len(free)))
    for row, mechanism in enumerate(mechanisms):
        name = f"{mechanism.name}.{mechanism.parameters[0].name}"
        if name in free:
            pick[row, free.index(name)] = 1.0
    return pick @ candidate.mean, pick @ candidate.covariance @ pick.T

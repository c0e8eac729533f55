"""Whether one trial was handed over twice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.recording.smoothing import sample_noise
from legfem.recording.trial import Recording

_SAME_NOISE = 0.95
_LEAST_NOISE_N = 5e-4
"""Below it noise may be no more than rounding, which copies and repeats share."""
_FEWEST = 20
_LIKE_SIGNS = 0.7
"""Of changes of slope: a quick look before the ranks."""


def refuse_copies(other: Recording, recordings: Sequence[Recording]) -> None:
    """Check that a recording is no copy of others: moved in time, scaled, thinned or resampled.

    Raises
    ------
    InputError
        For two that share their noise, which no repeat does.
    """
    for one in recordings:
        if _copied(one, other):
            raise InputError(
                str(other.source or other.trial),
                "force_N",
                f"is a copy of {one.trial}: the two have the same noise, which no repeat has",
                "remove one of them; a copy makes the result look surer than it is",
            )


def _copied(one: Recording, other: Recording) -> bool:
    if len(one) == len(other) and np.array_equal(one.force, other.force):
        return True
    n = min(len(one), len(other))
    pairs = [(one.force[:n], other.force[:n]), _at_times(one, other), _at_times(other, one)]
    return any(_alike(*pair) for pair in pairs)


def _at_times(one: Recording, other: Recording) -> tuple[FloatArray, FloatArray]:
    """Return the force of one, and of another, at the other's times since its start."""
    since, asked = one.time - one.time[0], other.time - other.time[0]
    within = asked <= since[-1]
    return np.interp(asked[within], since, one.force), other.force[within]


def _alike(a: FloatArray, b: FloatArray) -> bool:
    a2, b2 = np.diff(a, 2), np.diff(b, 2)
    if len(a) < _FEWEST or np.mean(a2 * b2 > 0) < _LIKE_SIGNS:
        return False
    if min(sample_noise(a), sample_noise(b)) <= _LEAST_NOISE_N:
        return False
    from scipy.stats import spearmanr

    # By ranks: one jump that both trials share is no noise.
    return bool(spearmanr(a2, b2).statistic > _SAME_NOISE)

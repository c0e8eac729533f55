"""What readings can't have been: a clock that counts rows, a cell at its limit, a spike, a copy."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from legfem.common.doubts import Doubt
from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.data.recording import Recording
from legfem.data.smoothing import sample_noise

_MANY_ROWS = 200
"""Of loading: with one a second it would take minutes."""
_LEVEL_SHARES = np.geomspace(0.02, 0.7, 40)
"""Of a loading's way, that may be level at its end."""
_LEVEL_EXACTLY = 0.1
"""Of a loading's way, above which one value to the last digit is no chance."""
_FEW, _LEVEL, _OF_NOISE, _BEYOND_NOISE = 8, 0.1, 2.0, 6.0
"""Samples at least; its rise over that before at most, its scatter over the noise at most, and the
rise before over the noise at least. On 98 public recordings of beef and silicone nothing is."""
_SPIKE = 0.15
"""Of the force's range: corners of loadings sampled at 10 Hz have up to 0.07."""


def counts_samples(time: FloatArray) -> bool:
    """Return whether times (n,) of a loading seem to be the rows' number."""
    return len(time) > _MANY_ROWS and np.allclose(np.diff(time), 1.0, 0.0, 1e-6)


def cut_off(displacement: FloatArray, force: FloatArray) -> float:
    """Return the way (mm) of a loading in which the force was cut off; 0 where it wasn't.

    Parameters
    ----------
    displacement, force
        (n,), mm and N, of a loading.
    """
    exactly = _exactly_level(displacement, force)
    few = _LEVEL_EXACTLY * float(np.ptp(displacement))
    return max(exactly if exactly > few else 0.0, _level_at_end(displacement, force))


def _exactly_level(displacement: FloatArray, force: FloatArray) -> float:
    """Return the longest way (mm) in which the force stays at its greatest value exactly."""
    top = np.append(force >= force.max(), False)
    edges = np.flatnonzero(np.diff(top.astype(int), prepend=0)).reshape(-1, 2)
    return max(float(displacement[end - 1] - displacement[start]) for start, end in edges)


def _level_at_end(displacement: FloatArray, force: FloatArray) -> float:
    """Return the way (mm) at the end of a loading in which the force rises no more.

    Soft tissue stiffens, so a force that is level within its noise, and rose before by far more
    than that in as long a way, was cut off.
    """
    noise = max(sample_noise(force), 1e-9 * float(np.ptp(force)))
    left, found = displacement[-1] - displacement, 0.0
    for way in float(np.ptp(displacement)) * _LEVEL_SHARES:
        end, before = left <= way, (left > way) & (left <= 2 * way)
        if min(np.count_nonzero(end), np.count_nonzero(before)) < _FEW:
            continue
        rise, rose = (way * _slope(displacement[part], force[part]) for part in (end, before))
        is_level = abs(rise) < _LEVEL * rose and np.std(force[end]) < _OF_NOISE * noise
        if is_level and rose > _BEYOND_NOISE * noise:
            found = way
    return found


def _slope(displacement: FloatArray, force: FloatArray) -> float:
    """Return the slope of the straight line through a part of a loading, N/mm."""
    away = displacement - displacement.mean()
    square = float(away @ away)
    return float(away @ force) / square if square > 0 else 0.0


def spike_doubts(source: str, recording: Recording) -> Iterator[Doubt]:
    """Yield a doubt about a reading of the force that is far from its neighbours."""
    at = spike(recording.force)
    if at is not None:
        yield Doubt(
            source,
            "force_N",
            f"one reading, {recording.force[at]:.4g} N at {recording.time[at]:.4g} s, stands alone",
            "remove the row if it is a disturbance",
        )


def spike(force: FloatArray) -> int | None:
    """Return the number of the reading (of n) that is farthest from its neighbours, if too far.

    Two readings before it and two after it lie together, and it doesn't.
    """
    if len(force) < 5:
        return None
    around = np.lib.stride_tricks.sliding_window_view(force, 5)
    middle = np.median(around, axis=1)
    off = np.abs(force[2:-2] - middle)
    together = np.ptp(np.delete(around, 2, axis=1), axis=1) < 0.5 * off
    off = np.where(together, off, 0.0)
    worst = int(np.argmax(off))
    return worst + 2 if off[worst] > _SPIKE * np.ptp(middle) else None


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

"""What readings can't have been: a clock that counts rows, a cell at its limit, a spike."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from legfem.common.doubts import Doubt
from legfem.common.units import FloatArray
from legfem.recording import Recording

_MANY_ROWS = 200
"""Of loading: with one a second it would take minutes."""
_SPIKE = 0.15
"""Of the force's range: corners of loadings sampled at 10 Hz have up to 0.07."""


def counts_samples(time: FloatArray) -> bool:
    """Return whether times (n,) of a loading seem to be the rows' number."""
    return len(time) > _MANY_ROWS and np.allclose(np.diff(time), 1.0, 0.0, 1e-6)


def cut_off(displacement: FloatArray, force: FloatArray) -> float:
    """Return the longest way (mm) in which the force stays at its greatest value exactly.

    Parameters
    ----------
    displacement, force
        (n,), mm and N, of a loading.
    """
    top = np.append(force >= force.max(), False)
    edges = np.flatnonzero(np.diff(top.astype(int), prepend=0)).reshape(-1, 2)
    return max(float(displacement[end - 1] - displacement[start]) for start, end in edges)


def spike_doubts(source: str, recording: Recording) -> Iterator[Doubt]:
    """Yield a doubt about a reading of the force that is far from its neighbours."""
    at = spike(recording.force)
    if at is not None:
        yield Doubt(
            source, "force_N",
            f"one reading, {recording.force[at]:.4g} N at {recording.time[at]:.4g} s, stands alone",
            "remove the row if it is a disturbance",
        )  # fmt: skip


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

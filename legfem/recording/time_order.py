"""Time that doesn't increase from row to row."""

from __future__ import annotations

import numpy as np

from legfem.common.units import FloatArray


def not_increasing(time: FloatArray) -> list[int]:
    """Return the rows whose time isn't after that of the row before."""
    return [int(row) for row in np.flatnonzero(np.diff(time) <= 0) + 1]


def backwards(time: FloatArray, row: int) -> str:
    """Return what time does at such a row, its bracket open for more."""
    word = "repeats" if time[row] == time[row - 1] else "runs backwards"
    return f"time {word} ({time[row - 1]:g} s, then {time[row]:g} s"

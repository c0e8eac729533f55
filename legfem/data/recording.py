"""One trial as it was recorded, and writing it as the reader wants it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from legfem.channels.kind import ChannelAccuracy, ChannelKind
from legfem.channels.registry import CHANNELS
from legfem.common.units import FloatArray, frozen_array


@dataclass(frozen=True, eq=False)
class RecordedChannel:
    """What one channel read in a trial.

    Parameters
    ----------
    name : str
        Of its kind in `CHANNELS`.
    time : (k,) array
        s, on the recording's clock, increasing at each place; read-only.
    values : (k,) array
        In the kind's unit; read-only.
    accuracy : ChannelAccuracy
        Of the instrument.
    source : Path, optional
        File of its own; a column of the recording without it.
    course : (k,) int array
        Number of the place of each reading; all zero of a channel that has no places.
    places
        At which it was read, the same in all trials of a site.
    """

    name: str
    time: FloatArray
    values: FloatArray
    accuracy: ChannelAccuracy
    source: Path | None = None
    course: NDArray[np.int_] | None = None
    places: tuple[tuple[float, ...], ...] = ()

    def __post_init__(self) -> None:
        """Keep read-only copies; raise ValueError if the arrays' shapes differ."""
        for field in ("time", "values"):
            object.__setattr__(self, field, frozen_array(getattr(self, field)))
        if not (self.time.ndim == 1 and self.time.shape == self.values.shape):
            raise ValueError("time and values must be (k,) arrays of one length")

    @property
    def place(self) -> FloatArray:
        """Of each reading (k, q); q = 0 of a channel that has no places."""
        return np.zeros((len(self.time), 0)) if self.course is None else np.array(self.places)[self.course]

    def at_each_place(self) -> Iterator[tuple[int, RecordedChannel]]:
        """Yield the number of every place and what was read there; of a channel without places 0 and itself."""
        if self.course is None:
            yield 0, self
            return
        for number in np.unique(self.course):
            mine = self.course == number
            yield int(number), replace(self, time=self.time[mine], values=self.values[mine], course=None, places=())

    @property
    def kind(self) -> ChannelKind:
        """What it is."""
        return CHANNELS[self.name]


@dataclass(frozen=True, eq=False)
class Recording:
    """One trial, untouched.

    Parameters
    ----------
    time : (n,) array
        s, strictly increasing; read-only.
    displacement : (n,) array
        mm, growing towards the leg; read-only.
    force : (n,) array
        N, positive in compression; read-only.
    trial : str
        Name of the trial (the file's stem).
    source : Path or None
        File it was read from.
    channels : tuple of RecordedChannel
        What else was recorded.
    timed : bool
        Whether a clock gave the time; that of a table of stretch and stress counts its way.
    """

    time: FloatArray
    displacement: FloatArray
    force: FloatArray
    trial: str
    source: Path | None = None
    channels: tuple[RecordedChannel, ...] = ()
    timed: bool = True

    def __post_init__(self) -> None:
        """Keep read-only copies; raise ValueError if the arrays' shapes differ."""
        for name in ("time", "displacement", "force"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        if not (self.time.ndim == 1 and self.time.shape == self.displacement.shape == self.force.shape):
            raise ValueError("time, displacement and force must be (n,) arrays of one length")

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.time)


MOST = 1e9
"""Of any reading in s, mm or N: beyond it a file is misread or damaged."""


_A_DATE = 1e8
"""s: no trial begins three years after its clock was set; clocks that count from 1904 or 1970 read more."""


def since_start(time: FloatArray) -> FloatArray:
    """Return times (n,) from the first on where they count from a calendar's date; else as they are."""
    return time - time[0] if len(time) and _A_DATE < time[0] < np.inf else time


def not_increasing(time: FloatArray) -> list[int]:
    """Return the rows whose time isn't after that of the row before."""
    return [int(row) for row in np.flatnonzero(np.diff(time) <= 0) + 1]


def backwards(time: FloatArray, row: int) -> str:
    """Return what time does at such a row, its bracket open for more."""
    word = "repeats" if time[row] == time[row - 1] else "runs backwards"
    return f"time {word} ({time[row - 1]:g} s, then {time[row]:g} s"


def write_recording(recording: Recording, path: Path) -> None:
    """Write ``time_s,displacement_mm,force_N`` and a column for each channel, to 0.1 um and 0.1 mN.

    A channel's readings stand in the rows nearest in time, several in one as their mean; its other cells are empty.
    A channel that is read at places has a file of its own.
    """
    import pandas as pd

    columns = {"time_s": recording.time, "displacement_mm": recording.displacement, "force_N": recording.force}
    for one in recording.channels:
        if one.places:
            continue
        between = 0.5 * (recording.time[1:] + recording.time[:-1])
        row = np.searchsorted(between, one.time)
        count = np.bincount(row, minlength=len(recording))
        total = np.bincount(row, one.values, minlength=len(recording))
        columns[one.kind.column] = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    pd.DataFrame(columns).round(4).to_csv(path, index=False)


Origin = Literal["measured", "reconstructed", "simulated"]

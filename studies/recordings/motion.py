"""How a specimen was pressed, as recorded: the drive slows down before it stops."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from legfem.common.units import FloatArray
from legfem.data import Recording, segment
from legfem.data.segmentation import AIR, HOLD
from legfem.inverse.observations import Observations

_HELD_WITHIN_MM = 0.02
_BACK_SHARE = 0.02
"""Of the depth: by how much the indenter is drawn back when the hold is over."""


def loaded_and_held(recording: Recording) -> Recording:
    """Return the recording from the first motion to the end of the hold.

    The depth is that of the hold, its median: one sample that overshoots doesn't count.
    """
    d = recording.displacement
    depth = held_depth(recording)
    start = max(0, int(np.argmax(d > d[0] + 0.01 * (depth - d[0]))) - 2)
    arrived = int(np.argmax(d > (1 - 0.5 * _BACK_SHARE) * depth))
    back = d[arrived:] < (1 - _BACK_SHARE) * depth
    # Two in a row: one sample is an outlier.
    left = np.flatnonzero(back[:-1] & back[1:])
    end = arrived + int(left[0]) - 2 if len(left) else len(d)
    return _part(recording, slice(start, end))


def held_depth(recording: Recording) -> float:
    """Return the displacement (mm) at which the indenter stayed longest of its greatest ones."""
    d = recording.displacement
    deep = d[d > 0.9 * np.sort(d)[-min(3, len(d))]]
    counts, edges = np.histogram(deep, bins=60)
    best = int(np.argmax(counts))
    return float(np.median(deep[(deep >= edges[best]) & (deep <= edges[best + 1])]))


def without_end_of_hold(recording: Recording, seconds: float) -> Recording:
    """Return the recording less its last seconds."""
    time = recording.time
    return _part(recording, slice(0, int(np.searchsorted(time, time[-1] - seconds, "right"))))


def _part(recording: Recording, part: slice) -> Recording:
    return replace(
        recording,
        time=recording.time[part] - recording.time[part][0],
        displacement=recording.displacement[part],
        force=recording.force[part],
    )


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion of one trial from first touch on.

    Parameters
    ----------
    time, displacement
        (w,), s and mm after first contact; straight between.
    hold_starts
        s.
    """

    time: FloatArray
    displacement: FloatArray
    hold_starts: float

    def at_stations(self, observed: Observations) -> FloatArray:
        """Return the times (n,), s, on this clock, of a trial's observations."""
        before = self.time <= self.hold_starts
        d = np.maximum.accumulate(self.displacement[before])
        rising = np.concatenate([[True], np.diff(d) > 0])
        held: NDArray[np.bool_] = observed.phase == HOLD
        loading = np.interp(observed.displacement, d[rising], self.time[before][rising])
        if not held.any():
            return np.asarray(loading)
        begun = observed.protocols[0].protocol.time[int(observed.segment[held][0])]
        return np.where(held, self.hold_starts + observed.time - begun, loading)


def motion_of(recording: Recording, observed: Observations) -> Motion:
    """Return the motion of a recording that `observe` was given."""
    contact = observed.contacts[0]
    labels = segment(recording).touching(contact).labels
    d = recording.displacement - contact.displacement
    touched = (labels != AIR) & (d > 0)
    time, d = recording.time[touched], d[touched]
    speed = np.polyfit(time[:5], d[:5], 1)[0]
    begins = time[0] - d[0] / speed if speed > 0 else time[0] - (time[1] - time[0])
    held = recording.time[labels == HOLD]
    stops = held[0] if len(held) else time[-1]
    return Motion(np.concatenate([[0.0], time - begins]), np.concatenate([[0.0], d]), float(stops - begins))

"""A trial cut into loading, holds and unloading, counted from first contact."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.data.contact import Contact
from legfem.data.recording import Recording
from legfem.data.segmentation import AIR, HOLD, LOADING, least_way, split_phases
from legfem.data.smoothing import sample_noise, smooth_displacement

_SHORTEST_SEGMENT = 8
_CORNER_MM = 0.1


@dataclass(frozen=True, eq=False)
class Segment:
    """A stretch of one trial in one phase; arrays are (k,), of none while it is in air."""

    phase: str
    time: FloatArray
    """s since first contact."""
    displacement: FloatArray
    """mm after first contact, smoothed over time."""
    force: FloatArray
    """N above the baseline."""
    leverage: FloatArray
    """Variance of the smoothed displacement over that of one reading."""
    duration: float
    """s, with the ends next to other segments that the arrays leave out."""
    end: float
    """mm after first contact, where it ends."""

    @property
    def depth(self) -> float:
        """Greatest displacement, mm, of a corner too if the arrays leave much of it out."""
        deepest = float(self.displacement.max(initial=0.0))
        return self.end if self.end > deepest + 2 * _CORNER_MM else deepest

    @property
    def rate(self) -> float:
        """Speed by a straight line, mm/s; negative in unloading."""
        return float(np.polyfit(self.time, self.displacement, 1)[0])


@dataclass(frozen=True, eq=False)
class Trial:
    """One recording cut into its phases."""

    name: str
    segments: tuple[Segment, ...]
    contact: Contact
    white_force_sd: float
    """N, of one reading."""
    jitter_sd: float
    """mm, of one reading."""
    pressed_again: bool
    """Whether the skin was left and pressed once more, which the segments leave out."""

    @property
    def depth(self) -> float:
        """Greatest displacement after contact, mm."""
        return max(segment.depth for segment in self.segments)

    @property
    def reach(self) -> float:
        """Greatest displacement that was recorded, air included, mm."""
        return self.depth + self.contact.displacement

    @property
    def phases(self) -> tuple[str, ...]:
        """Names of the segments' phases in order."""
        return tuple(segment.phase for segment in self.segments)


def cut_trial(recording: Recording, contact: Contact) -> Trial:
    """Cut a recording into loading, hold and unloading, counted from first contact.

    Raises
    ------
    InputError
        If there is no loading after contact, or too few samples of it.
    """
    labels = split_phases(recording, contact)
    deepest = float(recording.displacement.max()) - contact.displacement
    least = least_way(recording.displacement)
    segments: list[Segment] = []
    edges = np.flatnonzero(np.diff(np.unique(labels, return_inverse=True)[1], prepend=-1))
    smoothed, _ = smooth_displacement(recording.time, recording.displacement)
    start_time, left, pressed_again = 0.0, False, False
    for start, end in zip(edges, [*edges[1:], len(labels)], strict=True):
        phase = str(labels[start])
        if phase == AIR and segments:
            out = smoothed[start:end]
            rises = float((out - np.minimum.accumulate(out)).max())
            pressed_again = pressed_again or rises > 0.5 * deepest
            lowest = float(smoothed[start:end].min()) - contact.displacement
            level = lowest if lowest > 0.05 * deepest else 0.0
            segments[-1], left = replace(segments[-1], end=level), True
        if phase == AIR:
            continue
        if end - start < _SHORTEST_SEGMENT:
            if phase == LOADING and not segments:
                raise InputError(
                    recording.source or recording.trial,
                    "rows",
                    f"{end - start} samples of the first loading are too few",
                    "sample faster or press more slowly",
                )
            continue
        part = _within_corners(recording, phase, start, end)
        if part.stop - part.start < _SHORTEST_SEGMENT:
            continue
        time, raw = recording.time[part], recording.displacement[part]
        smooth, leverage = (
            (np.full_like(raw, raw.mean()), np.full_like(raw, 1.0 / len(raw)))
            if phase == HOLD
            else smooth_displacement(time, raw)
        )
        smooth = smooth - contact.displacement
        if not segments:
            if phase == HOLD and smooth[0] < max(least, 0.05 * deepest):
                continue  # a rest at the skin, which it doesn't press
            speed = (smooth[-1] - smooth[0]) / (time[-1] - time[0])
            start_time = float(time[0] - max(smooth[0], 0.0) / max(speed, 1e-9))
        force = recording.force[part] - contact.baseline
        whole = float(recording.time[end - 1] - recording.time[start])
        stops = float(smooth[-1])
        if phase != HOLD:
            stops += (smooth[-1] - smooth[0]) * float((recording.time[end - 1] - time[-1]) / (time[-1] - time[0]))
        made = Segment(phase, time - start_time, smooth, force, leverage, whole, stops)
        if left:
            segments.append(_in_air(segments[-1], made))
            left = False
        elif phase == HOLD and segments:
            segments[-1] = replace(segments[-1], end=stops)
        if phase == HOLD or abs(stops - (segments[-1].end if segments else 0.0)) > least:
            segments.append(made)
    if not segments or segments[0].phase != LOADING:
        raise InputError(
            recording.source or recording.trial,
            "displacement_mm",
            "the trial does not begin with loading",
            "take it out, or start it at first contact",
        )
    if segments[-1].phase == AIR:
        segments.pop()
    return Trial(
        recording.trial,
        tuple(segments),
        contact,
        sample_noise(recording.force),
        sample_noise(recording.displacement),
        pressed_again,
    )


def _in_air(before: Segment, after: Segment) -> Segment:
    """Return the time between drawing back as far as ``before`` ends and pressing again there."""
    leaves = before.time[-1] + (before.end - before.displacement[-1]) / min(before.rate, -1e-9)
    comes = after.time[0] + (before.end - after.displacement[0]) / max(after.rate, 1e-9)
    none = np.zeros(0)
    step = float(after.time[1] - after.time[0])
    return Segment(AIR, none, none, none, none, max(float(comes - leaves), step), before.end)


def _within_corners(recording: Recording, phase: str, start: int, end: int) -> slice:
    """Return a segment without its ends next to other segments: corners are known roughly only.

    A moving segment loses a tenth of a millimetre there, at least two samples.
    """
    cut = 2
    if phase != HOLD:
        way = abs(recording.displacement[end - 1] - recording.displacement[start])
        cut = max(cut, int(np.ceil(_CORNER_MM * (end - start) / max(way, 1e-9))))
    last = len(recording.time)
    cut = max(0, min(cut, (end - start - _SHORTEST_SEGMENT) // 2))
    return slice(start + (cut if start > 0 else 0), end - (cut if end < last else 0))


def changes_speed(segment: Segment) -> bool:
    """Return whether a moving segment was driven at more than one speed."""
    if segment.phase in (HOLD, AIR):
        return False
    line = np.polynomial.Polynomial.fit(segment.time, segment.displacement, 1)
    away = np.abs(segment.displacement - line(segment.time)).max()
    return bool(away > 0.03 * np.ptp(segment.displacement))

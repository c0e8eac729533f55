"""Where recordings and model are compared: a few dozen stations along each protocol.

Trials that were driven alike (same phases, rates and depth) share a protocol and its stations:
displacements in loading and unloading, times in a hold.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.recording.contact import Contact
from legfem.recording.phases import AIR, HOLD, LOADING, split_phases
from legfem.recording.smoothing import local_line, sample_noise, smooth_displacement
from legfem.recording.trial import Recording
from legfem.solve.protocol import Protocol

LOADING_STATIONS, HOLD_STATIONS, UNLOADING_STATIONS = 40, 12, 24
_SHORTEST_SEGMENT = 8
_CORNER_MM = 0.1
# Trials whose rates, holds and depths agree this well were driven alike.
_RATE_TOLERANCE, _DEPTH_TOLERANCE = 0.06, 0.03


@dataclass(frozen=True, eq=False)
class Segment:
    """A stretch of one trial in one phase; arrays are (k,)."""

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
        return max(float(segment.displacement.max()) for segment in self.segments)

    @property
    def reach(self) -> float:
        """Greatest displacement that was recorded, air included, mm."""
        return self.depth + self.contact.displacement

    @property
    def phases(self) -> tuple[str, ...]:
        """Names of the segments' phases in order."""
        return tuple(segment.phase for segment in self.segments)


@dataclass(frozen=True, eq=False)
class Stations:
    """Stations along one protocol; arrays are (m,)."""

    protocol: Protocol
    phase: NDArray[np.str_]
    segment: NDArray[np.int_]
    """Number of the protocol's segment."""
    displacement: FloatArray
    """mm."""
    time: FloatArray
    """s since first contact."""

    @property
    def depth(self) -> float:
        """Greatest displacement, mm."""
        return float(np.max(self.protocol.displacement))

    @cached_property
    def key(self) -> str:
        """Name that only these stations have."""
        what = [self.protocol.time, self.protocol.displacement, self.time.tolist()]
        return hashlib.sha256(json.dumps(what).encode()).hexdigest()[:16]

    @property
    def label(self) -> str:
        """What a reader knows it by."""
        return ", ".join(
            f"{p.rate:.2g} mm/s to {p.last:.3g} mm" if p.phase == LOADING else p.phase
            for p in self.protocol.segments
        )


def cut_trial(recording: Recording, contact: Contact) -> Trial:
    """Cut a recording into loading, hold and unloading, counted from first contact.

    Raises
    ------
    InputError
        If there is no loading after contact.
    """
    labels = _without_twitches(split_phases(recording, contact), recording.displacement)
    segments: list[Segment] = []
    edges = np.flatnonzero(np.diff(np.unique(labels, return_inverse=True)[1], prepend=-1))
    start_time = None
    for start, end in zip(edges, [*edges[1:], len(labels)], strict=True):
        phase = str(labels[start])
        if phase == AIR or end - start < _SHORTEST_SEGMENT:
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
        if start_time is None:
            speed = (smooth[-1] - smooth[0]) / (time[-1] - time[0])
            start_time = float(time[0] - max(smooth[0], 0.0) / max(speed, 1e-9))
        force = recording.force[part] - contact.baseline
        whole = float(recording.time[end - 1] - recording.time[start])
        segments.append(Segment(phase, time - start_time, smooth, force, leverage, whole))
    if not segments or segments[0].phase != LOADING:
        raise InputError(
            recording.source or recording.trial, "displacement_mm",
            "the trial does not begin with loading", "take it out, or start it at first contact",
        )  # fmt: skip
    touched = np.maximum.accumulate(labels != AIR)
    out = recording.displacement[touched & (labels == AIR)] - contact.displacement
    depth = max(float(segment.displacement.max()) for segment in segments)
    return Trial(
        recording.trial,
        tuple(segments),
        contact,
        sample_noise(recording.force),
        sample_noise(recording.displacement),
        bool((out > 0.5 * depth).any()),
    )


def _without_twitches(labels: NDArray[np.str_], displacement: FloatArray) -> NDArray[np.str_]:
    """Call a hold what hardly moves between two holds: noise, not motion."""
    labels = labels.copy()
    edges = [*np.flatnonzero(labels[1:] != labels[:-1]) + 1, len(labels)]
    least = max(0.3, 0.02 * float(np.ptp(displacement)))
    for first, last in pairwise(edges):
        between_holds = labels[first - 1] == HOLD and last < len(labels) and labels[last] == HOLD
        if between_holds and abs(displacement[last - 1] - displacement[first]) < least:
            labels[first:last] = HOLD
    return labels


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
    if segment.phase == HOLD:
        return False
    line = np.polynomial.Polynomial.fit(segment.time, segment.displacement, 1)
    away = np.abs(segment.displacement - line(segment.time)).max()
    return bool(away > 0.03 * np.ptp(segment.displacement))


def group_trials(trials: Sequence[Trial]) -> list[list[int]]:
    """Return the trials' numbers, those driven alike together."""
    groups: list[list[int]] = []
    for k, trial in enumerate(trials):
        for group in groups:
            if _alike(trials[group[0]], trial):
                group.append(k)
                break
        else:
            groups.append([k])
    return groups


def _alike(a: Trial, b: Trial) -> bool:
    """Tell whether two trials follow one programme, however much air each begins with."""
    deep = min(abs(a.depth / b.depth - 1), abs(a.reach / b.reach - 1)) <= _DEPTH_TOLERANCE
    return (
        a.phases == b.phases
        and deep
        and all(_same_pace(x, y) for x, y in zip(a.segments, b.segments, strict=True))
    )


def _same_pace(a: Segment, b: Segment) -> bool:
    if a.phase == HOLD:
        return abs(a.duration / b.duration - 1) < _RATE_TOLERANCE
    return abs(a.rate / b.rate - 1) < _RATE_TOLERANCE


def stations_of(trials: Sequence[Trial]) -> Stations:
    """Return the stations of trials that were driven alike.

    Rates and holds are taken to two digits and depths to 0.1 mm, so that recordings of one protocol
    share their solutions; the forces are read at the trials' own displacements.
    """
    first = trials[0]
    depth = round(min(trial.depth for trial in trials), 1)
    times, displacements = [0.0], [0.0]
    phases: list[str] = []
    numbers: list[int] = []
    d_at: list[float] = []
    t_at: list[float] = []
    for number, phase in enumerate(first.phases):
        parts = [trial.segments[number] for trial in trials]
        before = displacements[-1]
        if phase == HOLD:
            duration = float(f"{min(part.duration for part in parts):.2g}")
            times.append(times[-1] + duration)
            displacements.append(before)
            sampling = float(np.median(np.diff(parts[0].time)))
            since = np.geomspace(max(3 * sampling, duration / 150), 0.97 * duration, HOLD_STATIONS)
            d: FloatArray = np.full(HOLD_STATIONS, before)
            t = times[-2] + since
        else:
            rate = float(f"{np.mean([abs(part.rate) for part in parts]):.2g}")
            if phase == LOADING:
                end = last = depth
                count = LOADING_STATIONS
            else:
                # Near lift-off recordings end anywhere; down to a quarter of the depth they don't.
                seen = max(float(part.displacement[-1]) for part in parts)
                last = max(0.25 * depth, 0.05 * depth * np.ceil(seen / (0.05 * depth) - 0.2))
                end = 0.0 if seen < 0.25 * depth else last
                count = UNLOADING_STATIONS
            duration = abs(end - before) / rate
            times.append(times[-1] + duration)
            displacements.append(end)
            way = (last - before) / (end - before)
            fraction = way * (np.arange(count) + 0.6) / count
            d = before + fraction * (end - before)
            t = times[-2] + fraction * duration
        phases += [phase] * len(d)
        numbers += [number] * len(d)
        d_at += list(d)
        t_at += list(t)
    protocol = Protocol(tuple(times), tuple(displacements))
    return Stations(protocol, np.array(phases), np.array(numbers), np.array(d_at), np.array(t_at))


def stations_along(protocol: Protocol) -> Stations:
    """Return the stations of a programme that wasn't recorded."""
    phase: list[str] = []
    number: list[int] = []
    time: list[float] = []
    counts = {LOADING: LOADING_STATIONS, HOLD: HOLD_STATIONS}
    for k, part in enumerate(protocol.segments):
        count = counts.get(part.phase, UNLOADING_STATIONS)
        share = (
            np.geomspace(1 / 150, 0.97, count)
            if part.phase == HOLD
            else (np.arange(count) + 0.6) / count
        )
        time += list(part.start + share * part.duration)
        phase += [part.phase] * count
        number += [k] * count
    at = np.array(time)
    return Stations(protocol, np.array(phase), np.array(number), protocol.displacement_at(at), at)


@dataclass(frozen=True, eq=False)
class Readings:
    """A trial brought to its protocol's stations; arrays are (m,)."""

    force: FloatArray
    """N."""
    white_leverage: FloatArray
    """Variance of ``force`` over that of one reading's white noise."""
    jitter_leverage: FloatArray
    """Variance of the smoothed displacement there over that of one reading."""


def read_at(trial: Trial, stations: Stations) -> Readings:
    """Bring a trial to stations, by straight lines fitted to the samples round each."""
    force, leverage, jitter = (np.empty(len(stations.time)) for _ in range(3))
    starts = stations.protocol.time
    for number, segment in enumerate(trial.segments):
        here = stations.segment == number
        if segment.phase == HOLD:
            since = stations.time[here] - starts[number]
            for k, at in zip(np.flatnonzero(here), since, strict=True):
                line = local_line(
                    segment.time - segment.time[0], segment.force, np.array([at]), 0.15 * at, 5
                )
                force[k], leverage[k] = line.value[0], line.leverage[0]
            jitter[here] = segment.leverage[0]
            continue
        d = stations.displacement[here]
        order = np.argsort(segment.displacement, kind="stable")
        half = 0.5 * abs(float(np.median(np.diff(d))))
        line = local_line(segment.displacement[order], segment.force[order], d, half)
        force[here], leverage[here] = line.value, line.leverage
        jitter[here] = np.interp(d, segment.displacement[order], segment.leverage[order])
    return Readings(force, leverage, jitter)

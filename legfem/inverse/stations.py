"""Where recordings and model are compared: a few dozen stations along each protocol.

Trials that were driven alike (same phases, rates and depth) share a protocol and its stations:
displacements in loading and unloading, times in a hold.
"""

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from legfem.common.units import FloatArray
from legfem.data.phases import AIR, HOLD, LOADING, UNLOADING
from legfem.data.segmentation import Segment, Segmentation
from legfem.data.smoothing import local_line
from legfem.solve.protocol import Protocol

LOADING_STATIONS, HOLD_STATIONS, UNLOADING_STATIONS = 40, 12, 24
# Trials whose rates, holds, depths and ends of phases agree this well were driven alike.
_RATE_TOLERANCE, _DEPTH_TOLERANCE, _END_TOLERANCE = 0.06, 0.03, 0.05


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
    def speed(self) -> FloatArray:
        """Speed of the cylinder, mm/s; negative as it is withdrawn."""
        rates = np.diff(self.protocol.displacement) / np.diff(self.protocol.time)
        return np.asarray(rates[self.segment])

    @cached_property
    def half_width(self) -> FloatArray:
        """Way to either side of a station within which forces are read, mm; nothing in a hold."""
        found = np.zeros(len(self.time))
        for number in np.unique(self.segment):
            here = self.segment == number
            if self.phase[here][0] in (LOADING, UNLOADING):
                found[here] = 0.5 * abs(float(np.median(np.diff(self.displacement[here]))))
        return found

    @cached_property
    def key(self) -> str:
        """Name that only these stations have."""
        what = [self.protocol.time, self.protocol.displacement, self.time.tolist()]
        return hashlib.sha256(json.dumps(what).encode()).hexdigest()[:16]

    @property
    def label(self) -> str:
        """What a reader knows it by."""
        return ", ".join(
            f"{p.rate:.2g} mm/s to {p.last:.3g} mm" if p.phase == LOADING else p.phase for p in self.protocol.segments
        )


def group_trials(trials: Sequence[Segmentation]) -> list[list[int]]:
    """Return the trials' numbers, those driven alike together.

    A third trial that lies between two joins them: apart, both may have the same stations.
    """
    groups: list[list[int]] = []
    for k, trial in enumerate(trials):
        mine = [group for group in groups if any(_alike(trials[j], trial) for j in group)]
        groups = [group for group in groups if group not in mine]
        groups.append(sorted([k, *(j for group in mine for j in group)]))
    return sorted(groups)


def _alike(a: Segmentation, b: Segmentation) -> bool:
    """Tell whether two trials follow one programme, however much air each begins with."""
    deep = min(abs(a.depth / b.depth - 1), abs(a.reach / b.reach - 1)) <= _DEPTH_TOLERANCE
    return (
        a.phases == b.phases
        and deep
        and all(
            _same_pace(x, y) and abs(x.end - y.end) <= _END_TOLERANCE * a.depth + abs(a.depth - b.depth)
            for x, y in zip(a.segments, b.segments, strict=True)
        )
    )


def _same_pace(a: Segment, b: Segment) -> bool:
    if a.phase in (HOLD, AIR):
        return abs(a.duration / b.duration - 1) < _RATE_TOLERANCE
    return abs(a.rate / b.rate - 1) < _RATE_TOLERANCE


def stations_of(trials: Sequence[Segmentation]) -> Stations:
    """Return the stations of trials that were driven alike.

    Rates and holds are taken to two digits and depths to three, so that recordings of one protocol share their
    solutions; the forces are read at the trials' own displacements, and nowhere beyond them. While the skin is left
    there are no stations.
    """
    first = trials[0]
    depth = min(trial.depth for trial in trials)
    digits = 2 - math.floor(math.log10(depth))
    depth = round(depth, digits)
    times, displacements = [0.0], [0.0]
    found: list[_InSegment] = []
    for number, phase in enumerate(first.phases):
        parts = [trial.segments[number] for trial in trials]
        before = displacements[-1]
        if phase in (HOLD, AIR):
            duration = float(f"{min(part.duration for part in parts):.2g}")
            times.append(times[-1] + duration)
            displacements.append(before)
            if phase == AIR:
                continue
            sampling = float(np.median(np.diff(parts[0].time)))
            last = min(0.97 * duration, *(float(np.ptp(part.time)) for part in parts))
            since = np.geomspace(min(max(3 * sampling, duration / 150), last), last, HOLD_STATIONS)
            d: FloatArray = np.full(HOLD_STATIONS, before)
            t = times[-2] + since
        else:
            rate = float(f"{np.mean([abs(part.rate) for part in parts]):.2g}")
            end = round(float(np.mean([part.end for part in parts])), digits + 1)
            if phase == LOADING:
                short = np.mean([t.depth - p.end for t, p in zip(trials, parts, strict=True)])
                if short <= max(0.3 * first.scales.way, _DEPTH_TOLERANCE * depth):
                    end = depth
                last = end
                count = LOADING_STATIONS
            else:
                # Near lift-off recordings end anywhere; down to a quarter of the depth they don't.
                if end < 0.05 * depth:
                    end = 0.0
                seen = max(float(part.displacement[-1]) for part in parts)
                last = 0.05 * before * np.ceil(seen / (0.05 * before) - 0.2)
                last = max(0.25 * before, end, last)
                count = UNLOADING_STATIONS
            duration = abs(end - before) / rate
            times.append(times[-1] + duration)
            displacements.append(end)
            d = _places(before, last, count, parts)
            t = times[-2] + (d - before) / (end - before) * duration
        found.append((phase, number, d, t))
    return _joined(Protocol(tuple(times), tuple(displacements)), found)


type _InSegment = tuple[str, int, FloatArray, FloatArray]
"""Phase and number of a segment, with displacement and time of its stations."""


def _joined(protocol: Protocol, found: Sequence[_InSegment]) -> Stations:
    phase, number, d, t = zip(*found, strict=True)
    sizes = list(map(len, t))
    return Stations(protocol, np.repeat(phase, sizes), np.repeat(number, sizes), np.concatenate(d), np.concatenate(t))


def _places(before: float, last: float, count: int, parts: Sequence[Segment]) -> FloatArray:
    """Return places (n,) along a way, mm, within what all trials recorded of it."""
    first, last = (before + (last - before) * step / count for step in (0.6, count - 0.4))
    low, high = max(p.displacement.min() for p in parts), min(p.displacement.max() for p in parts)
    if low < high:
        first, last = (min(max(end, low), high) for end in (first, last))
    return np.linspace(first, last, count)


def stations_along(protocol: Protocol) -> Stations:
    """Return the stations of a programme that wasn't recorded."""
    found: list[_InSegment] = []
    counts = {LOADING: LOADING_STATIONS, HOLD: HOLD_STATIONS}
    for k, part in enumerate(protocol.segments):
        count = counts.get(part.phase, UNLOADING_STATIONS)
        share = np.geomspace(1 / 150, 0.97, count) if part.phase == HOLD else (np.arange(count) + 0.6) / count
        at = part.start + share * part.duration
        found.append((part.phase, k, protocol.displacement_at(at), at))
    return _joined(protocol, found)


@dataclass(frozen=True, eq=False)
class StationReadings:
    """A trial brought to its protocol's stations; arrays are (m,)."""

    force: FloatArray
    """N."""
    white_leverage: FloatArray
    """Variance of ``force`` over that of one reading's white noise."""
    jitter_leverage: FloatArray
    """Variance of the smoothed displacement there over that of one reading."""


def read_at(trial: Segmentation, stations: Stations) -> StationReadings:
    """Bring a trial to stations, by straight lines fitted to the samples round each."""
    force, leverage, jitter = (np.empty(len(stations.time)) for _ in range(3))
    starts = stations.protocol.time
    for number, segment in enumerate(trial.segments):
        here = stations.segment == number
        if segment.phase == AIR:
            continue
        if segment.phase == HOLD:
            since = stations.time[here] - starts[number]
            for k, at in zip(np.flatnonzero(here), since, strict=True):
                line = local_line(segment.time - segment.time[0], segment.force, np.array([at]), 0.15 * at, 5)
                force[k], leverage[k] = line.value[0], line.leverage[0]
            jitter[here] = segment.leverage[0]
            continue
        d = stations.displacement[here]
        order = np.argsort(segment.displacement, kind="stable")
        line = local_line(segment.displacement[order], segment.force[order], d, stations.half_width[here])
        force[here], leverage[here] = line.value, line.leverage
        jitter[here] = np.interp(d, segment.displacement[order], segment.leverage[order])
    return StationReadings(force, leverage, jitter)


def since_touch(displacement: FloatArray, half_width: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return ways after touch (n,), mm, whose forces are read at displacements (n,), and the shares that count.

    A force is read by a straight line through what lies within a half-width h (n,) to either side, and where touch
    lies within it, too, that is the mean of what is nothing before: with a force that begins in proportion to its way
    x, (x + h) / (2 h) times the force at (x + h) / 2.
    """
    ahead = 0.5 * (displacement + half_width)
    share = np.clip(ahead / np.maximum(half_width, 1e-100), 0.0, 1.0)
    return np.maximum(np.maximum(displacement, ahead), 0.0), share

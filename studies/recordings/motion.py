"""How a specimen was pressed, as recorded; sudden losses of force; what it answers, for the diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from legfem.common.units import FloatArray, kpa_to_mpa, mpa_to_kpa
from legfem.data import Recording, segment
from legfem.data.phases import AIR, HOLD
from legfem.data.smoothing import sample_noise
from legfem.inverse.body_models import Columns
from legfem.inverse.mechanism import strength
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter
from legfem.mechanisms import Mechanism, Stiffness, TissueMechanism, Values
from legfem.mechanisms.time_dependence import TIMES_S, TissueRelaxation
from studies.recordings.curves import ElasticCurves

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


_LEAST_SHARE = 0.05
"""Of the peak force: less isn't called a drop."""
_NOISES = 8.0
_BEFORE = 8
"""Samples whose straight line tells what was to come."""


@dataclass(frozen=True)
class Drop:
    """A jump of the force in loading."""

    start_mm: float
    end_mm: float
    start_s: float
    end_s: float
    size_N: float
    """Of the loss, against the line through the samples before."""


def find_drops(recording: Recording) -> tuple[Drop, ...]:
    """Find where the force falls although the indenter goes in.

    Falling stretches of the loading are measured against the straight line through the eight
    samples before them; those that lose more than 5 % of the peak force and eight standard
    deviations of the force's noise are drops.
    """
    d, force = recording.displacement, recording.force
    last = int(np.argmax(force))
    moving = np.diff(d[: last + 1]) > 0.3 * np.median(np.diff(d[: last + 1]))
    falling = np.diff(force[: last + 1]) < 0
    limit = max(_LEAST_SHARE * float(np.ptp(force)), _NOISES * sample_noise(force))
    edges = np.flatnonzero(np.diff((falling & moving).astype(int), prepend=0, append=0))
    found = []
    for start, end in edges.reshape(-1, 2):
        if start < _BEFORE:
            continue
        before = slice(start - _BEFORE + 1, start + 1)
        line = np.polyfit(d[before], force[before], 1)
        size = float(np.polyval(line, d[end]) - force[end])
        if size > limit:
            found.append(
                Drop(float(d[start]), float(d[end]), float(recording.time[start]), float(recording.time[end]), size)
            )
    return tuple(found)


@dataclass(frozen=True)
class ForceDrop(Mechanism):
    """A step of the force at a known displacement of the loading, which stays."""

    at_mm: float = 0.0
    """After first contact."""
    name: ClassVar[str] = "force-drop"
    statement: ClassVar[str] = (
        "the force fell suddenly while the indenter went in: the specimen slipped, tore or settled"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("size", "N", "force lost", 0.05, (0.0, 10.0), "five per cent of the peak"),
    )
    next_experiment: ClassVar[str] = "film the specimen's edge, and repeat at a fresh place"

    def added_force(self, values: Values, observed: Observations) -> FloatArray:
        """Return the loss, from the drop on."""
        later = (observed.phase != "loading") | (observed.displacement > self.at_mm)
        return -values["size"] * later.astype(float)


C10_BOUNDS_KPA = 0.02, 200.0
C20_BOUNDS_KPA = 0.0, 200.0
_LEAST_N = 1e-9
_KEPT = 50


@dataclass(frozen=True, eq=False)
class SpecimenResponses:
    """Responses of one specimen; see `legfem.inverse.predictor.Responses`.

    Parameters
    ----------
    curves
        Elastic.
    motion
        As recorded; without it nothing relaxes.
    """

    curves: ElasticCurves
    motion: Motion | None = None
    _weights: dict[int, FloatArray] = field(default_factory=dict, repr=False)
    _known: dict[tuple[float, int], FloatArray] = field(default_factory=dict, repr=False)
    _observed: list[Observations] = field(default_factory=list, repr=False)
    """Kept alive, so that their identities stay theirs."""

    @property
    def grid(self) -> FloatArray:
        """Displacements of the elastic curves, mm."""
        return self.curves.grid

    @property
    def c10_bounds(self) -> tuple[float, float]:
        """Stiffness C10 that it holds for, MPa."""
        return kpa_to_mpa(C10_BOUNDS_KPA[0]), kpa_to_mpa(C10_BOUNDS_KPA[1])

    @property
    def c20_bounds(self) -> tuple[float, float]:
        """Stiffness C20 that it holds for, MPa."""
        return kpa_to_mpa(C20_BOUNDS_KPA[0]), kpa_to_mpa(C20_BOUNDS_KPA[1])

    def curve(self, c10: float, c20: float) -> FloatArray:
        """Return the elastic force at the grid, N."""
        return self.curves.at(mpa_to_kpa(c10), mpa_to_kpa(c20))

    def relative_change(
        self, mechanism: TissueMechanism, values: Values, at: Stiffness, observed: Observations
    ) -> FloatArray:
        """Return what relaxation adds to the elastic force, over that force; (n,)."""
        if not isinstance(mechanism, TissueRelaxation) or self.motion is None:
            raise TypeError(f"no response to {mechanism.name}")
        c10, c20 = at
        share = c20 / (c10 + c20)
        return np.asarray(mechanism.shares(values) @ self._per_ratio(share, observed))

    def channel_curves(self, names: Sequence[str], c10: float, c20: float) -> FloatArray:
        """Refuse: nothing but the force is known."""
        raise LookupError(f"nothing is known of {', '.join(names)}")

    def channel_changes(self, names: Sequence[str], *of_mechanism: object) -> FloatArray:
        """Refuse likewise."""
        raise LookupError(f"nothing is known of {', '.join(names)}")

    def pair_change(self, pair: object, stiffness: Stiffness) -> Columns:
        """Return nothing: two effects act each as if alone."""
        return {}

    def _per_ratio(self, share: float, observed: Observations) -> FloatArray:
        """Return what every branch of ratio one adds, over the elastic force; (branches, n)."""
        key = share, id(observed)
        if key not in self._known:
            assert self.motion is not None
            times = self.motion.at_stations(observed)
            elastic = self._elastic(share)
            if id(observed) not in self._weights:
                self._weights[id(observed)] = _remembered(self.motion.time, times)
                self._observed.append(observed)
            weights = self._weights[id(observed)]
            at = np.interp(times, self.motion.time, self.motion.displacement)
            added = weights @ np.diff(elastic(self.motion.displacement))
            if len(self._known) > _KEPT:
                self._known.clear()
            self._known[key] = added / np.maximum(elastic(at), _LEAST_N)
        return self._known[key]

    def _elastic(self, share: float) -> CubicSpline:
        """Return the elastic force (N) with C10 + C20 of 1 kPa, by displacement (mm)."""
        grid = np.concatenate([[0.0], self.grid])
        return CubicSpline(grid, np.concatenate([[0.0], self.curves.at(1.0 - share, share)]))


def _remembered(waypoints: FloatArray, times: FloatArray) -> FloatArray:
    """Return the share (branches, n, w - 1) of each step's rise that a branch still bears."""
    start, end = waypoints[:-1], waypoints[1:]
    until = np.clip(times[:, None], start, end)
    tau = np.array(TIMES_S)[:, None, None]

    def faded(since: FloatArray) -> FloatArray:
        return np.exp(-np.maximum(times[:, None] - since, 0.0) / tau)

    return np.asarray(tau * (faded(until) - faded(start)) / (end - start))

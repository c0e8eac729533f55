"""One reading of a recording: its first contact and noise, its phases, and its segments.

Whatever looks at a recording (preview, plausibility, identification, diagnosis, specimens) looks at its `Segmentation`.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from legfem.common.errors import InputError
from legfem.common.units import FloatArray, runs_of
from legfem.data.contact import LEG, SHORT_OF_TRAVEL, Contact, Scales, contact_at_start, first_contact, fit_onset
from legfem.data.noise import UNSTATED, Instrument
from legfem.data.phases import AIR, HOLD, LOADING, UNLOADING, before_tear, least_way, phases_of_motion
from legfem.data.recording import Recording
from legfem.data.smoothing import sample_noise, smooth_displacement, without_outliers
from legfem.data.stress_tables import roughness

_SHORTEST_SEGMENT = 8
"""Fewest samples of a segment."""
_MOSTLY_AIR = 0.5 * SHORT_OF_TRAVEL
"""Ways of `Scales` in a specimen's press, fewer of which have scales of their own: the rest was air."""
_CORNER = 0.1
"""Share of a way of `Scales` that a segment leaves out next to others."""


@dataclass(frozen=True)
class MotionPart:
    """A phase of a recording, by the recording's own time and displacement."""

    phase: str
    start: float
    """s."""
    end: float
    """s."""
    first: float
    """mm."""
    last: float
    """mm."""

    @property
    def rate(self) -> float:
        """Speed, mm/s."""
        return (self.last - self.first) / max(self.end - self.start, 1e-12)


@dataclass(frozen=True, eq=False)
class Loading:
    """A trial's way from its start to its deepest point; arrays are (n,)."""

    displacement: FloatArray
    """mm after first contact, smoothed."""
    force: FloatArray
    """N above the baseline."""
    speed: float
    """mm/s, between a fifth and four fifths of the depth."""

    @property
    def depth(self) -> float:
        """Greatest displacement, mm."""
        return float(self.displacement[-1])

    def force_near(self, displacement: float) -> float:
        """Return the mean force within a quarter of a millimetre of a displacement, N."""
        near = np.abs(self.displacement - displacement) <= 0.25
        if not near.any():
            near = np.zeros(len(near), bool)
            near[int(np.argmin(np.abs(self.displacement - displacement)))] = True
        return float(self.force[near].mean())


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
    corner: float = _CORNER
    """mm next to other segments that the arrays leave out."""

    @property
    def depth(self) -> float:
        """Greatest displacement, mm, of a corner too if the arrays leave much of it out."""
        deepest = float(self.displacement.max(initial=0.0))
        return self.end if self.end > deepest + 2 * self.corner else deepest

    @property
    def rate(self) -> float:
        """Speed by a straight line, mm/s; negative in unloading."""
        return float(np.polyfit(self.time, self.displacement, 1)[0])

    @property
    def changes_speed(self) -> bool:
        """Whether a moving segment was driven at more than one speed."""
        if self.phase in (HOLD, AIR):
            return False
        line = np.polynomial.Polynomial.fit(self.time, self.displacement, 1)
        return bool(np.abs(self.displacement - line(self.time)).max() > 0.03 * np.ptp(self.displacement))


@dataclass(frozen=True, eq=False)
class Segmentation:
    """A recording as it is read: `segment` makes it; arrays are (n,) as the recording's.

    What is looked for in it is found when it is first asked for, and kept.
    """

    recording: Recording
    contact: Contact
    """Where it touches first, by the recording's own displacement."""
    smooth: FloatArray = field(repr=False)
    """Displacement smoothed over time, mm."""
    instrument: Instrument = UNSTATED
    scales: Scales = LEG

    @property
    def name(self) -> str:
        """Name of the trial."""
        return self.recording.trial

    @property
    def source(self) -> str:
        """File, or the trial's name without one: what a refusal begins with."""
        return str(self.recording.source or self.recording.trial)

    @cached_property
    def force_noise(self) -> float:
        """Standard deviation of the force from sample to sample, N."""
        recording = self.recording
        return sample_noise(recording.force) if recording.timed else roughness(recording.displacement, recording.force)

    @cached_property
    def displacement_noise(self) -> float:
        """Standard deviation of the displacement from sample to sample, mm."""
        return sample_noise(self.recording.displacement) if self.recording.timed else 0.0

    @cached_property
    def detected(self) -> Contact:
        """First contact as the recording by itself shows it, whatever is said of it."""
        return first_contact(self.smooth, self.recording, self.instrument, self.scales)

    def touching(self, contact: Contact) -> "Segmentation":
        """Return the same recording with another first contact."""
        return replace(self, contact=contact)

    @cached_property
    def labels(self) -> NDArray[np.str_]:
        """Every sample's phase: ``loading``, ``hold``, ``unloading`` or ``air``.

        The velocity, from straight lines over a window wide enough for the sensor's noise,
        gives the phases; their corners are then fitted. Before first contact, and after the
        force has come back to its baseline, the indenter is in air.
        """
        t, d = self.recording.time, without_outliers(self.recording.displacement)
        touched = np.append(np.flatnonzero(self.smooth >= self.contact.displacement), len(t))
        air = touched[0] if self.contact.in_air else 0
        # A thin specimen's holds are short beside the air before them.
        first = 0 if self.scales is LEG or len(t) - air < _SHORTEST_SEGMENT else air
        labels = np.append(np.full(first, AIR), phases_of_motion(t[first:], d[first:], self.scales.way))
        labels[:air] = AIR
        _mark_separation(self, labels)
        return labels

    def loading_depths(self, times: FloatArray) -> FloatArray:
        """Return depths (mm after first contact) at times (s) of the first loading; NaN at others.

        In air before it the depth is 0.
        """
        time, depth = self.recording.time, self.smooth - self.contact.displacement
        nearest = np.clip(np.searchsorted(time, times), 0, len(time) - 1)
        first = (self.labels == LOADING) & (np.arange(len(time)) <= self.deepest)
        before = np.arange(len(time)) < np.argmax(first)
        at = np.interp(times, time, depth)
        found = np.where(first[nearest], np.maximum(at, 0.0), np.where(before[nearest], 0.0, np.nan))
        return np.where((times < time[0]) | (times > time[-1]), np.nan, found)

    @property
    def parts(self) -> tuple[MotionPart, ...]:
        """The phases one after the other; a motion begins and ends where the hold beside it is."""
        time, d, runs = self.recording.time, self.recording.displacement, runs_of(self.labels)
        ends = self.smooth.copy()
        for start, end in (run for run in runs if self.labels[run[0]] == HOLD):
            few = max(1, (end - start) // 5)
            first, last = float(np.median(d[start : start + few])), float(np.median(d[end - few : end]))
            ends[max(start - 1, 0) : start + 1], ends[end - 1 : end + 1] = first, last
        return tuple(
            MotionPart(str(self.labels[a]), float(time[a]), float(time[b - 1]), float(ends[a]), float(ends[b - 1]))
            for a, b in runs
        )

    @cached_property
    def deepest(self) -> int:
        """Sample of the greatest displacement."""
        return int(np.argmax(self.smooth))

    @cached_property
    def loading(self) -> Loading:
        """All up to the greatest displacement."""
        end = self.deepest + 1
        d = self.smooth[:end] - self.contact.displacement
        low, high = (int(np.argmax(d >= share * d[-1])) for share in (0.2, 0.8))
        taken = float(self.recording.time[high] - self.recording.time[low])
        speed = float(d[high] - d[low]) / taken if taken > 0 else np.inf
        return Loading(d, self.recording.force[:end] - self.contact.baseline, speed)

    @property
    def segments(self) -> tuple[Segment, ...]:
        """Loading, holds and unloading, counted from first contact.

        Raises
        ------
        InputError
            If there is no loading after contact, or too few samples of it.
        """
        return self._segments[0]

    @property
    def pressed_again(self) -> bool:
        """Whether the skin was left and pressed once more, which the segments leave out."""
        return self._segments[1]

    @property
    def touched(self) -> float:
        """Time of first contact by the recording's clock, s: that which the segments' times count from."""
        return self._segments[2]

    @property
    def phases(self) -> tuple[str, ...]:
        """Names of the segments' phases in order."""
        return tuple(segment.phase for segment in self.segments)

    @cached_property
    def depth(self) -> float:
        """Greatest displacement of the segments after contact, mm."""
        return max(segment.depth for segment in self.segments)

    @property
    def reach(self) -> float:
        """Greatest displacement that was recorded, air included, mm."""
        return self.depth + self.contact.displacement

    @cached_property
    def _segments(self) -> tuple[tuple[Segment, ...], bool, float]:
        recording, labels, contact, smoothed = self.recording, self.labels, self.contact, self.smooth
        deepest = float(recording.displacement.max()) - contact.displacement
        least = least_way(np.maximum(recording.displacement, contact.displacement), self.scales.way)
        segments: list[Segment] = []
        start_time, left, pressed_again = 0.0, False, False
        for start, end in runs_of(labels):
            phase = str(labels[start])
            if phase == AIR:
                if segments:
                    out = smoothed[start:end]
                    rises = float((out - np.minimum.accumulate(out)).max())
                    pressed_again = pressed_again or rises > 0.5 * deepest
                    lowest = float(out.min()) - contact.displacement
                    level = lowest if lowest > 0.05 * deepest else 0.0
                    segments[-1], left = replace(segments[-1], end=level), True
                continue
            if end - start < _SHORTEST_SEGMENT:
                if phase == LOADING and not segments:
                    problem = f"{end - start} samples of the first loading are too few"
                    remedy = "sample faster or press more slowly"
                    raise InputError(recording.source or recording.trial, "rows", problem, remedy)
                continue
            corner = _CORNER * self.scales.way
            part = _within_corners(recording, phase, start, end, corner)
            if part.stop - part.start < _SHORTEST_SEGMENT:
                continue
            time, raw = recording.time[part], recording.displacement[part]
            smooth, leverage = (
                (np.full_like(raw, raw.mean()), np.full_like(raw, 1.0 / len(raw)))
                if phase == HOLD
                else smooth_displacement(time, raw, self.scales.way)
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
            made = Segment(phase, time - start_time, smooth, force, leverage, whole, stops, corner)
            if left:
                segments.append(_in_air(segments[-1], made))
                left = False
            elif phase == HOLD and segments:
                segments[-1] = replace(segments[-1], end=stops)
            if phase == HOLD or abs(stops - (segments[-1].end if segments else 0.0)) > least:
                segments.append(made)
        if not segments or segments[0].phase != LOADING:
            problem = "the trial does not begin with loading"
            remedy = "remove it, or start it at first contact"
            raise InputError(recording.source or recording.trial, "displacement_mm", problem, remedy)
        if segments[-1].phase == AIR:
            segments.pop()
        return tuple(segments), pressed_again, start_time


def before_it_tears(recording: Recording) -> Recording:
    """Return what was recorded of a specimen before it tore."""
    count = before_tear(recording.time, recording.displacement, recording.force)
    return recording if count == len(recording) else replace(recording.part(slice(count)), torn=True)


def segment(
    recording: Recording, instrument: Instrument = UNSTATED, starts_at_contact: bool = False, scales: Scales = LEG
) -> Segmentation:
    """Read a recording: smooth its displacement, and find where it touches first.

    Parameters
    ----------
    recording
        The trial.
    instrument
        Errors of a reading; what the recording itself shows where that is larger.
    starts_at_contact
        Whether displacement is known to count from first touch; air isn't looked for then.
    scales
        What is short, and weak, in the test.

    Raises
    ------
    InputError
        If there are hardly any samples.
    """
    if len(recording) < _SHORTEST_SEGMENT:
        remedy = "record a whole press, with at least 20 during loading"
        raise InputError(recording.source or recording.trial, "rows", f"{len(recording)} samples are too few", remedy)
    recording = recording if scales is LEG else before_it_tears(recording)
    smooth, _ = smooth_displacement(recording.time, recording.displacement, scales.way)
    found = Segmentation(recording, contact_at_start(), smooth, instrument, scales)
    if starts_at_contact:
        return found
    found = found.touching(found.detected)
    pressed = float(smooth.max()) - found.contact.displacement if found.contact.in_air else np.inf
    if scales is LEG or not 5 * found.displacement_noise < pressed < _MOSTLY_AIR * scales.way:
        return found
    return segment(recording, instrument, scales=replace(scales, way=pressed / SHORT_OF_TRAVEL))


def _mark_separation(trial: Segmentation, labels: NDArray[np.str_]) -> None:
    """Call air what follows the force's return to a constant, until the skin is pressed again.

    Unloading is read backwards for it. Where the first loading met no force there either, first
    contact isn't where it is said to be, and all that follows is called air.
    """
    recording, smooth, contact = trial.recording, trial.smooth, trial.contact
    runs = runs_of(labels)
    for k, (start, end) in enumerate(runs):
        if labels[start] != UNLOADING or LOADING not in labels[:start] or end - start < 20:
            continue
        start = max(start, start + int(np.argmax(recording.displacement[start:end])) + 1)
        part = slice(start, end)
        smooth_part, _ = smooth_displacement(recording.time[part], recording.displacement[part], trial.scales.way)
        jitter = replace(UNSTATED, displacement_sd=trial.displacement_noise)
        onset = fit_onset(smooth_part[::-1], recording.force[part][::-1], jitter, trial.scales)
        left = start + np.flatnonzero(smooth_part < onset.displacement)
        if not onset.in_air or len(left) == 0:
            continue
        if _in_vain(trial, labels, onset):
            labels[left[0] :] = AIR
            return
        # The way back to the start, in air, is no press.
        pressed = onset.displacement + 0.05 * (float(smooth.max()) - contact.displacement)
        again = next((a for a, b in runs[k + 1 :] if labels[a] == LOADING and smooth[a:b].max() > pressed), len(labels))
        labels[left[0] : again] = AIR
        deeper = np.flatnonzero(smooth[again:] >= contact.displacement)
        labels[again : again + deeper[0] if len(deeper) else len(labels)] = AIR


def _in_vain(trial: Segmentation, labels: NDArray[np.str_], left: Contact) -> bool:
    """Tell whether the first loading met no force on the way from contact to where skin was left.

    Of less than a tenth of the depth nothing can be told.
    """
    smooth, contact, force = trial.smooth, trial.contact, trial.recording.force
    loading = np.flatnonzero(labels == LOADING)
    depth = float(smooth.max()) - contact.displacement
    if left.displacement - contact.displacement < 0.1 * depth:
        return False
    first = loading[: np.argmax(smooth[loading] >= left.displacement)]
    few = max(3, len(first) // 5)
    if len(first) < 2 * few:
        return False
    rise = float(np.median(force[first[-few:]]) - np.median(force[first[:few]]))
    return rise < max(3.0 * trial.force_noise, 0.005 * float(np.ptp(force)))


def _in_air(before: Segment, after: Segment) -> Segment:
    """Return the time between drawing back as far as ``before`` ends and pressing again there."""
    leaves = before.time[-1] + (before.end - before.displacement[-1]) / min(before.rate, -1e-9)
    comes = after.time[0] + (before.end - after.displacement[0]) / max(after.rate, 1e-9)
    none = np.zeros(0)
    step = float(after.time[1] - after.time[0])
    return Segment(AIR, none, none, none, none, max(float(comes - leaves), step), before.end, before.corner)


def _within_corners(recording: Recording, phase: str, start: int, end: int, corner: float) -> slice:
    """Return a segment without its ends next to other segments: corners are known roughly only.

    A moving segment loses ``corner`` mm there, at least two samples.
    """
    cut = 2
    if phase != HOLD:
        way = abs(recording.displacement[end - 1] - recording.displacement[start])
        cut = max(cut, int(np.ceil(corner * (end - start) / max(way, 1e-9))))
    last = len(recording.time)
    cut = max(0, min(cut, (end - start - _SHORTEST_SEGMENT) // 2))
    return slice(start + (cut if start > 0 else 0), end - (cut if end < last else 0))

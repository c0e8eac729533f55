"""What in a leg's recordings and in channels beside the force can't be or is unlikely: another leg's, another unit."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.polynomial import Polynomial

from legfem.channels.kind import Impossible, ReadingsAtSite
from legfem.channels.kinds import FILE_OF
from legfem.common.errors import Doubt, InputError
from legfem.common.units import FloatArray, spaced_unit
from legfem.data import Segmentation
from legfem.data.channel_reader import LONGEST_LAG_S, files_named
from legfem.data.formats import recording_files
from legfem.data.formats.sheet import file_of
from legfem.data.plausibility import loading_doubts, pull_doubts, refuse_copies, trial_doubts, unread_doubts
from legfem.data.ranges import MISTAKEN_UNITS, RANGES
from legfem.data.recording import RecordedChannel
from legfem.geometry.indenter import Indenter, Site
from legfem.geometry.section import LegSection, depth_to_bone, fat_thickness, girth
from legfem.legs.subject import Subject

SOFTEST_KPA, STIFFEST_KPA = 0.05, 10.0
"""C10 of the two deep tissues."""
_LEAST = (-4.452, 0.145, 0.139, 0.417, -0.994, 0.327, 1.195, 1.159, 0.002)
_MOST = (-0.623, 0.185, 0.026, -0.33, 0.519, 0.103, 0.853, 2.98, -0.481)


def force_range(subject: Subject, displacement: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the least and the most force (N) at displacements (mm) after first touch.

    Of a fat and a fascia as the subject's folder states them.
    """
    fat, fascia = (1e3 * (subject.tissues[name].C10 or 0.0) for name in ("superficial", "fascia"))
    about = features(subject.section, subject.indenter, fat, fascia, subject.tissues["superficial"].D1, displacement)
    length = subject.indenter.length
    return length * np.exp(about @ _LEAST), length * np.exp(about @ _MOST)


def features(
    section: LegSection, indenter: Indenter, fat_kpa: float, fascia_kpa: float, fat_d1: float, displacement: FloatArray
) -> FloatArray:
    """Return what the logarithm of the force per length (N/mm) is linear in, (n, 9)."""
    aim, direction = indenter.aim, indenter.direction
    fat = max(fat_thickness(section, aim, direction), 0.5)
    depth = np.asarray(displacement, dtype=np.float64)
    share = np.minimum(depth / depth_to_bone(section, aim, direction), 1.0)
    same = [
        1.0,
        math.log(fat_kpa / 2.0),
        math.log(fascia_kpa * section.fascia_thickness / 60.0),
        math.log(fat / 6.0),
        math.log(girth(section) / 360.0),
        math.log(indenter.radius / 15.0),
    ]
    with_depth = np.log(depth / 20.0), -np.log(1 - 0.9 * share)
    compressible = np.full(len(depth), math.log(fat_d1 / 22.5))
    return np.column_stack([np.tile(same, (len(depth), 1)), *with_depth, compressible])


_LITTLE_ROOM = 0.96
"""Share of the way to the bone beyond which next to nothing is left of the tissue."""
_NOISE_FACTOR = 5.0
_QUIET, _SOFT = 0.15, 3.0
"""Noise so far below what is stated is a sign of another unit where the leg is soft, too."""
SLACK = 1.3
"""That legs like none of those solved for may lie beyond the envelopes."""
_IMPOSSIBLE = 20.0
"""Times the most, or the least, that a leg can push back."""


def doubts_about_recordings(subject: Subject, toml: Path, room: float) -> Iterator[Doubt]:
    """Yield what is unlikely.

    Parameters
    ----------
    subject : Subject
        Whose recordings they are.
    toml : Path
        Its file.
    room : float
        mm that the cylinder can go; see `legfem.legs.plausibility.room_before`.

    Raises
    ------
    InputError
        For what can't be.
    """
    if (stated := subject.instrument).stated:
        yield from RANGES["force_sd"].doubts(toml, "instrument.force_sd_N", stated.force_sd)
        yield from RANGES["displacement_sd"].doubts(toml, "instrument.displacement_sd_mm", stated.displacement_sd)
    if not subject.recordings:
        return
    for k, recording in enumerate(subject.recordings):
        refuse_copies(recording, subject.recordings[:k])
    yield from _unread(subject)
    for trial in subject.trials:
        yield from _motion(trial, room)
    yield from trial_doubts(subject.trials)
    yield from _force(subject)
    if subject.instrument.stated:
        yield from _noise(subject, toml)


def _unread(subject: Subject) -> Iterator[Doubt]:
    read = {file_of(one.source) for one in subject.recordings if one.source is not None}
    folders = {path.parent for path in read}
    sources = {channel.source for one in subject.recordings for channel in one.channels if channel.source is not None}
    read |= {file for source in sources for file in files_named(source)}
    others = sorted(file for folder in folders for file in recording_files(folder) if file not in read)
    them = "it" if len(others) == 1 else "them"
    yield from unread_doubts(next(iter(folders), subject.directory), others, f"remove {them}")


def _motion(trial: Segmentation, room: float) -> Iterator[Doubt]:
    loading = trial.loading
    # A displacement that doesn't count from the skin has no speed either.
    if loading.depth > _LITTLE_ROOM * room:
        there = f"there is room for {room:.1f} mm before a bone or the leg's far side"
        problem = f"the cylinder goes {loading.depth:.1f} mm deep where {there}"
        remedy = "check the unit, and aim_mm, direction_deg and diameter_mm in subject.toml"
        yield from Doubt(trial.source, "displacement_mm", problem, remedy).refused_if(loading.depth > room + 0.5)
    yield from RANGES["speed"].doubts(trial.source, "time_s", loading.speed)
    time = trial.recording.time[: len(loading.force)]
    yield from loading_doubts(trial.source, time, loading.displacement, loading.force)
    yield from pull_doubts(trial)


def _force(subject: Subject) -> Iterator[Doubt]:
    if not subject.indenter.lies_along or subject.section.lacks:  # the envelopes are of sections with fat and bone
        return
    loadings = [trial.loading for trial in subject.trials]
    at = np.linspace(0.2, 0.9, 8) * min(loading.depth for loading in loadings)
    force = np.array([np.median([one.force_near(d) for one in loadings]) for d in at])
    error = 2 * subject.instrument.force_sd / np.sqrt(len(loadings)) + 0.02
    low, high = force_range(subject, at)
    quiet = subject.instrument.stated and _noise_seen(subject) < _QUIET * subject.instrument.force_sd
    low, high = low * (_SOFT if quiet else 1 / SLACK), high * SLACK
    below, above = (force + error) / low, (force - error) / high
    if below.min() >= 1 and above.max() <= 1:
        return
    soft = below.min() < 1
    k = int(np.argmin(below) if soft else np.argmax(above))
    hints = [
        f"if it is in {unit}, multiply it by {factor:g}"
        for unit, factor in MISTAKEN_UNITS["force_N"].items()
        if (low <= factor * force + error).all() and (factor * force - error <= high).all()
    ]
    noise = f", and its noise is {_QUIET:g} times the stated force_sd_N or less" if soft and quiet else ""
    less, very = ("less", "soft") if soft else ("more", "stiff")
    problem = f"{force[k]:.3g} N at {at[k]:.1f} mm are {less} than the {(low if soft else high)[k]:.2g} N with which "
    problem += f"this leg would push back if it were very {very} inside{noise}"
    remedy = " or ".join([*hints, "check length_mm, C10_kPa and D1_per_MPa of the tissues, aim_mm"])
    found = Doubt(str(subject.directory / "recordings"), "force_N", problem, remedy)
    yield from found.refused_if(not (1 / _IMPOSSIBLE < below.min() and above.max() < _IMPOSSIBLE))


def _noise_seen(subject: Subject) -> float:
    """Return the force's noise from sample to sample, N."""
    return float(np.median([trial.force_noise for trial in subject.trials]))


def _noise(subject: Subject, toml: Path) -> Iterator[Doubt]:
    seen = _noise_seen(subject)
    stated = subject.instrument.force_sd
    if seen > _NOISE_FACTOR * stated + 0.01:
        problem = f"{stated:.3g} N is stated, but force_N jumps by {seen:.3g} N from sample to sample"
        yield Doubt(str(toml), "instrument.force_sd_N", problem, "check the unit of force_N, or the stated accuracy")


_FARTHEST_LAG_S = 3.0
"""That is looked for."""
_TIMES_AS_LONG = 50.0
"""As the recording: a channel in ms would be a thousand times."""
_FEWEST_READINGS = 10
"""At displacements of their own, that show one."""


def check_channels(trial: Segmentation, section: LegSection, indenter: Indenter, outline_sd: float = 0.0) -> None:
    """Check a trial's channels against its force and displacement, and against the section.

    Parameters
    ----------
    trial
        With its channels.
    section, indenter
        Of the site.
    outline_sd
        Standard deviation of the section's outlines, mm.

    Raises
    ------
    InputError
        For what can't be; names file, channel and remedy.
    """
    for channel in trial.recording.channels:
        found = _untimely(channel, trial)
        if found is None:
            force = np.interp(channel.time, trial.recording.time, trial.recording.force - trial.contact.baseline)
            depths, site = trial.loading_depths(channel.time), Site(section, indenter)
            recorded = ReadingsAtSite(channel.values, depths, force, channel.accuracy, site, outline_sd, channel.place)
            found = FILE_OF[channel.name].check(channel.kind, recorded)
        if found is not None:
            raise InputError(trial.source, channel.name, found.what, found.remedy)


def _untimely(channel: RecordedChannel, trial: Segmentation) -> Impossible | None:
    """Return why a channel wasn't read in a trial; None where it may have been."""
    if not np.isfinite(channel.values).all() or not len(channel.values):
        return Impossible("has no readings", "leave the column out")
    time = trial.recording.time
    if not np.isfinite(trial.loading_depths(channel.time)).any():
        lies = f"({channel.time[0]:g} to {channel.time[-1]:g} s) lies in the loading of a recording from {time[0]:g} to"
        return Impossible(f"none of its readings {lies} {time[-1]:g} s", "give its times on the recording's clock")
    lasts, most = float(np.ptp(channel.time)), float(np.ptp(time))
    if lasts > _TIMES_AS_LONG * most:
        remedy = "give its times in s on the recording's clock, or its part within the recording"
        return Impossible(f"its readings last {lasts:.4g} s, and the recording {most:.4g} s", remedy)
    if len(channel.values) >= _FEWEST_READINGS and not np.ptp(channel.values):
        return Impossible(
            f"all its {len(channel.values)} readings are {channel.values[0] + 0.0:g}{spaced_unit(channel.kind.unit)}",
            "check that the sensor was connected, or leave the channel out",
        )
    # The place that moves most shows it best.
    lag = seen_lag(max((one for _, one in channel.at_each_place()), key=lambda one: float(np.ptp(one.values))), trial)
    if abs(lag) < LONGEST_LAG_S:
        return None
    late = (
        f"it follows the displacement {lag:+.1f} s late" if lag > 0 else f"it is {-lag:.1f} s ahead of the displacement"
    )
    return Impossible(late, f"subtract {lag:.1f} s from its times, and check the clocks")


def seen_lag(channel: RecordedChannel, trial: Segmentation) -> float:
    """Return by how much a channel seems to be late (s); 0 where that isn't clear.

    It is the shift at which a cubic of the displacement leaves a quarter of the sum of squares at most.
    """
    time, depth = trial.recording.time, trial.smooth
    if len(channel.values) < _FEWEST_READINGS:
        return 0.0
    lags = np.linspace(-_FARTHEST_LAG_S, _FARTHEST_LAG_S, 61)

    def left(lag: float) -> float:
        x = np.interp(channel.time - lag, time, depth)
        if len(np.unique(x)) < _FEWEST_READINGS:
            return np.inf
        return float(np.mean((Polynomial.fit(x, channel.values, 3)(x) - channel.values) ** 2))

    squares = np.array([left(lag) for lag in lags])
    now = left(0.0)
    clear = np.sqrt(now) > 2 * channel.accuracy.reading and squares.min() < 0.25 * now
    return float(lags[np.argmin(squares)]) if clear else 0.0

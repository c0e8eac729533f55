"""What a channel beside the force can't be: another leg's, another test's, or another column."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.data import Segmentation
from legfem.data.channel_reader import LONGEST_LAG_S
from legfem.data.channels import RecordedChannel
from legfem.data.segmentation import LOADING
from legfem.geometry.indenter import Indenter
from legfem.geometry.section import LegSection, layer_thicknesses

_FARTHEST_LAG_S = 3.0
"""That is looked for."""
_APART_MM, _APART = 3.0, 0.35
"""Of a thickness from the section's own: mm, or a share of it where that is more."""


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
        source = trial.source
        _check_time(channel, trial, source)
        if channel.name == "lateral_force":
            _check_lateral(channel, trial, source)
        if channel.name in ("fat_thickness", "muscle_thickness"):
            own = layer_thicknesses(section, indenter.aim, indenter.direction).get(channel.name)
            _check_thickness(channel, trial, source, own, outline_sd)


def loading_depths(channel: RecordedChannel, trial: Segmentation) -> FloatArray:
    """Return the depths (mm after first contact) of a channel's readings in the first loading; NaN of others.

    Readings in air before it have depth 0.
    """
    time, depth = trial.recording.time, trial.smooth - trial.contact.displacement
    nearest = np.clip(np.searchsorted(time, channel.time), 0, len(time) - 1)
    first = (trial.labels == LOADING) & (np.arange(len(time)) <= trial.deepest)
    before = np.arange(len(time)) < np.argmax(first)
    at = np.interp(channel.time, time, depth)
    found = np.where(first[nearest], np.maximum(at, 0.0), np.where(before[nearest], 0.0, np.nan))
    return np.where((channel.time < time[0]) | (channel.time > time[-1]), np.nan, found)


def _check_time(channel: RecordedChannel, trial: Segmentation, source: str) -> None:
    if not np.isfinite(channel.values).all() or not len(channel.values):
        raise InputError(source, channel.name, "has no readings", "leave the column out")
    if not np.isfinite(loading_depths(channel, trial)).any():
        t = trial.recording.time
        raise InputError(
            source,
            channel.name,
            f"none of its readings ({channel.time[0]:g} to {channel.time[-1]:g} s) lies in the loading of a recording "
            f"from {t[0]:g} to {t[-1]:g} s",
            "give its times on the recording's clock",
        )
    lag = seen_lag(channel, trial)
    if abs(lag) >= LONGEST_LAG_S:
        raise InputError(
            source,
            channel.name,
            f"it follows the displacement {lag:+.1f} s late"
            if lag > 0
            else f"it is {-lag:.1f} s ahead of the displacement",
            f"subtract {lag:.1f} s from its times, and check the clocks",
        )


def seen_lag(channel: RecordedChannel, trial: Segmentation) -> float:
    """Return by how much a channel seems to be late (s); 0 where that isn't clear.

    It is the shift at which a cubic of the displacement leaves a quarter of the sum of squares at most.
    """
    time, depth = trial.recording.time, trial.smooth
    if len(channel.values) < 10:
        return 0.0
    lags = np.linspace(-_FARTHEST_LAG_S, _FARTHEST_LAG_S, 61)

    def left(lag: float) -> float:
        x = np.interp(channel.time - lag, time, depth)
        if np.ptp(x) == 0:
            return np.inf
        return float(np.mean((Polynomial.fit(x, channel.values, 3)(x) - channel.values) ** 2))

    squares = np.array([left(lag) for lag in lags])
    now = left(0.0)
    clear = np.sqrt(now) > 2 * channel.accuracy.reading and squares.min() < 0.25 * now
    return float(lags[np.argmin(squares)]) if clear else 0.0


def _check_lateral(channel: RecordedChannel, trial: Segmentation, source: str) -> None:
    force = np.interp(channel.time, trial.recording.time, trial.recording.force - trial.contact.baseline)
    pressed = force > 0.2 * force.max()
    if pressed.any() and np.median(np.abs(channel.values[pressed]) / force[pressed]) > 1.0:
        worst = float(np.abs(channel.values[pressed]).max())
        raise InputError(
            source,
            "lateral_force",
            f"it is up to {worst:.3g} N, more than the force along the travel ({force.max():.3g} N)",
            "check which of the load cell's axes is which, and its zero",
        )


def _check_thickness(
    channel: RecordedChannel, trial: Segmentation, source: str, own: float | None, outline_sd: float
) -> None:
    name = channel.name.replace("_", " ")
    if own is None:
        raise InputError(
            source,
            channel.name,
            "the line of travel meets no bone in the section: there is no such thickness",
            "leave the column out, or correct aim_mm and direction_deg",
        )
    depth = loading_depths(channel, trial)
    kept = np.isfinite(depth)
    depth, values = depth[kept], channel.values[kept]
    # A single frame says little of how it changes.
    several = len(values) > 2 and np.ptp(depth) > 0
    start, end = Polynomial.fit(depth, values, 1)(np.array([0.0, depth.max()])) if several else (values[0], values[0])
    accuracy = channel.accuracy
    # Of a line through n readings.
    error = accuracy.reading * np.sqrt(12 / len(values))
    if several and end - start > max(3 * error, 0.05 * own):
        raise InputError(
            source,
            channel.name,
            f"the {name} grows from {start:.3g} to {end:.3g} mm as the cylinder presses",
            "check that the columns aren't exchanged, and that the frames are in order",
        )
    first = float(np.mean(values[depth <= depth.min() + 0.1 * np.ptp(depth)]))
    tolerance = max(_APART_MM, _APART * own, 3 * accuracy.bias, 3 * outline_sd) + float(depth.min())
    if abs(first - own) > tolerance:
        raise InputError(
            source,
            channel.name,
            f"the {name} is {first:.3g} mm at {depth.min():.2g} mm of depth, and the section's own is {own:.3g} mm",
            "check its unit, the outlines, and that both are along the line of travel",
        )

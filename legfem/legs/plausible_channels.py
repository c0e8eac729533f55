"""What a channel beside the force can't be: another leg's, another test's, or another column."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial

from legfem.channels.kind import Recorded, Site
from legfem.channels.registry import FILE_OF
from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.data import Segmentation
from legfem.data.channel_reader import LONGEST_LAG_S
from legfem.data.recording import RecordedChannel
from legfem.data.segmentation import LOADING
from legfem.geometry.indenter import Indenter
from legfem.geometry.section import LegSection

_FARTHEST_LAG_S = 3.0
"""That is looked for."""


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
        force = np.interp(channel.time, trial.recording.time, trial.recording.force - trial.contact.baseline)
        depths, values = loading_depths(channel, trial), channel.values
        recorded = Recorded(values, depths, force, channel.accuracy, Site(section, indenter), outline_sd, channel.place)
        found = FILE_OF[channel.name].check(channel.kind, recorded)
        if found is not None:
            raise InputError(source, channel.name, found.what, found.remedy)


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
    # The place that moves most shows it best.
    lag = seen_lag(max((one for _, one in channel.at_each_place()), key=lambda one: float(np.ptp(one.values))), trial)
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

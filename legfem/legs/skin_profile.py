"""The skin beside the cylinder as points of a scanner's or of cameras: its rises where the model has them.

A file has a frame a time: points ``x_mm, y_mm`` of the skin in the outlines' coordinates, tracked or not. Along the
line of travel, and at an offset to its left, the skin stands where a parabola through the points within a few
millimetres has it; its rise is how far that has moved against the travel since the first frame, which is taken before
the cylinder presses. So what is off in the registration of both systems cancels but for the skin's slope.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from legfem.common.errors import InputError
from legfem.common.input_files import read_table
from legfem.common.units import FloatArray
from legfem.data import Recording
from legfem.data.channel_reader import RecordedChannelEntry, channel_file
from legfem.data.channels import CHANNELS, RecordedChannel
from legfem.geometry.indenter import Indenter
from legfem.geometry.section import LegSection, across

_NEAR_MM = 4.0
"""Of an offset, on either side: points that a parabola goes through."""
_PRESSED = 0.03
"""Of the largest force: a first frame at more shows a leg that is pressed."""
_OFFSETS = {
    name: float(found[2]) * (1.0 if found[1] == "left" else -1.0)
    for name in CHANNELS
    if (found := re.fullmatch(r"skin_rise_(left|right)_(\d+)", name))
}
"""To the left of the travel (mm), by the channel's name."""


@dataclass(frozen=True, eq=False)
class TravelLine:
    """The line of travel in a section, and how far along it the skin's near half reaches (mm)."""

    aim: FloatArray
    direction: FloatArray
    half: float

    @classmethod
    def of(cls, section: LegSection, indenter: Indenter) -> TravelLine:
        """Return a test's."""
        aim, direction = np.asarray(indenter.aim), np.asarray(indenter.direction)
        middle = np.asarray(section.polygon("skin").centroid.coords[0])
        return cls(aim, direction, float((middle - aim) @ direction))

    def skin_at(self, points: FloatArray, offset: float) -> float:
        """Return where along the travel (mm) points (n, 2) have the skin at an offset; NaN where they haven't."""
        along = (points - self.aim) @ self.direction
        left = (points - self.aim) @ across(self.direction)
        near = (np.abs(left - offset) <= _NEAR_MM) & (along < self.half)
        at = left[near] - offset
        if len(at) < 2 or at.min() > 0 or at.max() < 0 or np.ptp(at) == 0:
            return float("nan")
        # The skin is curved: by 0.1 mm over a few millimetres.
        return float(np.polynomial.Polynomial.fit(at, along[near], min(2, len(at) - 1))(0.0))


def with_skin_profile(
    toml: Path, entry: RecordedChannelEntry | None, line: TravelLine, recordings: Sequence[Recording], site: str = ""
) -> tuple[Recording, ...]:
    """Return recordings with the skin's rises out of the files that ``[channels.skin_profile]`` names.

    Raises
    ------
    InputError
        If a file isn't there or holds no such frames, or if the first of them shows a leg that is pressed.
    """
    if entry is None or not recordings:
        return tuple(recordings)
    if entry.file is None or entry.column is not None:
        raise InputError(
            toml, "channels.skin_profile", "points have a file of their own", "give file, of time_s,x_mm,y_mm"
        )
    found = []
    for recording in recordings:
        path = channel_file(toml, entry, recording, len(recordings), "skin_profile", site)
        rises = _rises(path, line, recording)
        taken = {one.name for one in recording.channels} & set(rises)
        if taken:
            raise InputError(path, "skin_profile", f"{', '.join(taken)} is there already", "keep one of both")
        channels = [
            RecordedChannel(name, time, values, entry.accuracy(CHANNELS[name], toml), path)
            for name, (time, values) in rises.items()
        ]
        found.append(replace(recording, channels=(*recording.channels, *channels)))
    return tuple(found)


def _rises(path: Path, line: TravelLine, recording: Recording) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return times (s) and rises (mm) by the channel's name, of the offsets that all frames have."""
    table = read_table(path, ("time_s", "x_mm", "y_mm")).to_numpy(dtype=np.float64)
    times, frame = np.unique(table[:, 0], return_inverse=True)
    if len(times) < 2:
        raise InputError(
            path, "time_s", f"{len(times)} frame", "give the points of one frame a time, two times at least"
        )
    _refuse_pressed(path, float(times[0]), recording)
    found = {}
    for name, offset in _OFFSETS.items():
        along = np.array([line.skin_at(table[frame == k, 1:], offset) for k in range(len(times))])
        if np.isfinite(along).all():
            found[name] = times[1:], along[0] - along[1:]
    if not found:
        offsets = ", ".join(f"{value:+g}" for value in sorted(_OFFSETS.values()))
        raise InputError(
            path,
            "x_mm, y_mm",
            f"no frame after the first has the skin at any of {offsets} mm beside the line of travel",
            "give points in the outlines' coordinates, a few mm apart",
        )
    return found


def _refuse_pressed(path: Path, first: float, recording: Recording) -> None:
    force = recording.force - recording.force[0]
    at = float(np.interp(first, recording.time, force))
    if abs(at) > _PRESSED * np.abs(force).max():
        raise InputError(
            path,
            "time_s",
            f"the first frame, at {first:g} s, shows a leg pressed with {at:.2g} N already",
            "begin with a frame from before the cylinder presses: rises are counted from it",
        )

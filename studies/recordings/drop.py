"""A sudden loss of force while the indenter goes on: no tissue does that by itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from legfem.common.units import FloatArray
from legfem.data import Recording
from legfem.data.smoothing import sample_noise
from legfem.inverse.mechanism import strength
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter
from legfem.legs.mechanisms import Mechanism, Values

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

"""What concealed effects change of what was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from legfem.common.units import FloatArray
from legfem.data import Recording, segment
from legfem.inverse.observations import Observations
from legfem.inverse.stations import read_at
from studies.lab.conditions import drawn_errors
from studies.lab.recording import Course, record


def recorded(courses: Sequence[Course], noise_seed: int) -> list[Recording]:
    """Return what a lab records of trials, its errors drawn by a seed."""
    generator = np.random.default_rng(noise_seed)
    return record(courses, drawn_errors(generator), generator)


def recorded_change(courses: Sequence[Course], others: Sequence[Course], noise_seed: int) -> list[list[float]]:
    """Return how far a lab's readings of trials are from those it would have of others (N).

    Both by the same air, gains, zeros and noise, sample by sample.
    """
    pairs = zip(recorded(courses, noise_seed), recorded(others, noise_seed), strict=True)
    return [[float(v) for v in one.force - other.force] for one, other in pairs]


def change_at_stations(
    recordings: Sequence[Recording], changes: Sequence[Sequence[float]], observed: Observations
) -> FloatArray:
    """Return what changes of the recordings are at a diagnosis' stations (n,), N.

    Trials are cut at the first contacts that the diagnosis found, so that a change is looked up
    where it was recorded, however wrong these are.
    """
    parts = []
    for k, (recording, change) in enumerate(zip(recordings, changes, strict=True)):
        less = replace(recording, force=recording.force - np.asarray(change))
        trial = segment(less, starts_at_contact=True).touching(observed.contacts[k])
        parts.append(read_at(trial, observed.protocols[observed.protocol_of[k]]).force)
    return np.asarray(observed.force - np.concatenate(parts))

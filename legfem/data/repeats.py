"""First contacts of repeats, which have to agree: after it all of them press equally deep at one force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from legfem.common.units import FloatArray
from legfem.data.noise import UNSTATED, Instrument
from legfem.data.recording import Recording
from legfem.data.segmentation import Segmentation, segment
from legfem.data.smoothing import local_line

_LEVELS = np.linspace(0.1, 0.4, 7)
"""Of the least peak: where depths are compared, near contact and above the noise."""
_ALIKE = 0.05
"""Of the depth: what repeats differ by in stiffness, as a standard deviation."""
_READ = 0.05
"""mm: what a depth at a force errs by."""
_FEWEST = 8
"""Samples of loading."""


def segment_all(
    recordings: Sequence[Recording], instrument: Instrument = UNSTATED, starts_at_contact: bool = False
) -> tuple[Segmentation, ...]:
    """Read the recordings of one leg and one instrument; see `segment`."""
    return among_repeats([segment(one, instrument, starts_at_contact) for one in recordings])


def among_repeats(trials: Sequence[Segmentation]) -> tuple[Segmentation, ...]:
    """Return repeats of one press, each's first contact known no better than the others' agree with it.

    Where contact is put too late by some way, a force is reached that much less deep after it than in the others.
    """
    if len(trials) < 2 or min(len(one.loading.force) for one in trials) < _FEWEST:
        return tuple(trials)
    peak = min(float(np.max(one.loading.force)) for one in trials)
    depths = np.array([_depths(one, peak * _LEVELS) for one in trials])
    found = []
    for k, one in enumerate(trials):
        others = np.delete(depths, k, axis=0).mean(axis=0)
        # A repeat that is stiffer differs in proportion to the depth, one whose contact is elsewhere by one way.
        design = np.column_stack([np.ones_like(others), _ALIKE * others])
        design, left = np.vstack([design / _READ, [0.0, 1.0]]), np.append((depths[k] - others) / _READ, 0.0)
        apart = abs(float(np.linalg.lstsq(design, left)[0][0]))
        known = one.contact.known or not apart > one.contact.displacement_error
        found.append(one if known else one.touching(replace(one.contact, displacement_error=apart)))
    return tuple(found)


def _depths(trial: Segmentation, forces: FloatArray) -> FloatArray:
    """Return the displacements after contact (m,), mm, at which forces (m,) are first exceeded for good."""
    loading, way = trial.loading, trial.scales.way
    order = np.argsort(loading.displacement, kind="stable")
    d, force = loading.displacement[order], loading.force[order]
    grid = np.linspace(d[0], d[-1], 200)
    rising = np.maximum.accumulate(local_line(d, force, grid, 0.25 * way).value)
    return np.asarray(np.interp(forces, rising, grid))

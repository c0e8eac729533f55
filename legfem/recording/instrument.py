"""The instruments' noise, as the subject file states it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from legfem.recording.smoothing import sample_noise
from legfem.recording.trial import Recording

EXPECTED_GAIN_SD = 0.01
"""Of the gain from trial to trial, before they are compared: repeats on one site."""
WANDER_LENGTH_MM = 5.0
"""Way over which a displacement sensor's slow error changes."""
JITTER_LENGTH_MM = 0.5
"""Way over which smoothed displacement errs alike: half of what it is smoothed over."""
_LEAST_SLOW, _LEAST_WANDER = 0.12, 0.04
"""Shares of a stated accuracy's variance that are slow at least, however much jitter is seen."""


@dataclass(frozen=True)
class Instrument:
    """Standard deviations of a single reading.

    A stated accuracy (plus or minus a) is read as a uniform distribution, hence a standard
    deviation of a / sqrt(3); see `legfem.subjects.subject`.
    """

    force_sd: float
    """N."""
    displacement_sd: float
    """mm."""
    stated: bool = True
    """Whether a data sheet says so; else seen in the recordings, see `seen_instrument`."""

    def slow_force_sd(self, white_sd: float) -> float:
        """Return the load cell's slow error, N: what of its accuracy isn't seen as white noise."""
        whole = self.force_sd**2
        return float(np.sqrt(max(whole - white_sd**2, _LEAST_SLOW * whole)))

    def wander_sd(self, jitter_sd: float) -> float:
        """Return the displacement sensor's slow error, mm, likewise."""
        whole = self.displacement_sd**2
        return float(np.sqrt(max(whole - jitter_sd**2, _LEAST_WANDER * whole)))


def seen_instrument(recordings: Sequence[Recording]) -> Instrument:
    """Return the errors that recordings show from sample to sample, where none are stated.

    What is slow or the same in all trials isn't seen: these are lower bounds. At least a hundredth
    of a newton and of a millimetre.
    """
    force = [sample_noise(r.force) ** 2 for r in recordings]
    displacement = [sample_noise(r.displacement) ** 2 for r in recordings]
    return Instrument(
        max(0.01, float(np.sqrt(np.mean(force or [0.0])))),
        max(0.01, float(np.sqrt(np.mean(displacement or [0.0])))),
        stated=False,
    )

"""The instruments' noise, as the subject file states it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from legfem.recording.smoothing import sample_noise
from legfem.recording.trial import Recording


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

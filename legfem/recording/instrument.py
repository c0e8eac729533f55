"""The instruments' noise, as the subject file states it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Instrument:
    """Standard deviations of a single reading.

    A stated accuracy (plus or minus a) is read as a uniform distribution, hence a standard
    deviation of a / sqrt(3); see `legfem.subject`.
    """

    force_sd: float
    """N."""
    displacement_sd: float
    """mm."""

"""How much of a misfit an explanation takes up, and what it leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from legfem.diagnose.diagnosis import Diagnosis
from legfem.diagnose.explanation import Explanation, unknown_course
from legfem.diagnose.unknown import possible_discrepancies
from legfem.diagnose.windows import runs

_LEAST_OF_NOISE = 1.0
"""What remains is told where it is more than this share of a trial's noise, ..."""
_LEAST_OF_FORCE = 0.002
"""... and of the largest force."""


@dataclass(frozen=True)
class ResidualInterval:
    """An interval in which something is left over."""

    trial: str
    phase: str
    displacement_mm: tuple[float, float]
    size_N: float
    """Greatest of the expected course."""


def explained_share(found: Diagnosis, model: Explanation) -> float:
    """Return the share of the base model's misfit beyond noise that an explanation takes up.

    Misfits are sums of squares over the errors', less as many as there are observations.
    """
    before, after = found.alone.misfit_left, model.misfit_left
    return 1.0 - min(after / before, 1.0) if before > 0 else 0.0


def residual_intervals(found: Diagnosis, model: Explanation) -> list[ResidualInterval]:
    """Return where something unknown is left beside an explanation, the greatest first."""
    if not model.leaves:
        return []
    observed, base = found.observed, found.alone.fit
    course = unknown_course(model, possible_discrepancies(observed, base.prediction))
    least = np.maximum(_LEAST_OF_NOISE * found.errors.trial_sd, _LEAST_OF_FORCE * np.abs(base.prediction).max())
    marked = np.where(np.abs(course) > least, np.sign(course), 0).astype(int)
    result = []
    for k, trial in enumerate(observed.trials):
        for segment in np.unique(observed.segment[observed.trial == k]):
            here = np.flatnonzero((observed.trial == k) & (observed.segment == segment))
            for first, end in runs(marked[here]):
                run = here[first:end]
                d = observed.displacement[run]
                largest = run[int(np.argmax(np.abs(course[run])))]
                result.append(
                    ResidualInterval(
                        trial, str(observed.phase[run[0]]), (float(d.min()), float(d.max())), float(course[largest])
                    )
                )
    return sorted(result, key=lambda one: -abs(one.size_N))

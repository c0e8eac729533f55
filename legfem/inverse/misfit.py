"""How far a model misses, by size: over the largest force, and in what that does to C10."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.linearised import LinearisedFit, LinearisedProblem, equally_weighted, fit
from legfem.inverse.observations import Observations

_THIRDS = 3
_KEPT = 0.3
"""Of the readings, at least, without a part."""


@dataclass(frozen=True)
class Misfit:
    """A misfit's size."""

    size: float
    """Root mean square over the largest force."""
    moves: float
    """Greatest change of C10, over itself, by leaving out a phase or a third of the depth; nothing without C10."""


def misfit_of(problem: LinearisedProblem, ordinary: LinearisedFit) -> Misfit:
    """Return the size of what an ordinary fit leaves of the force.

    Parameters
    ----------
    problem
        The observations.
    ordinary
        The model's fit with equal weights.
    """
    observed = problem.predictor.observed
    forces = observed.data.spans[0]
    counted = np.ones(len(observed.values), dtype=bool) if problem.aside is None else ~problem.aside
    left = ordinary.residual[forces][counted[forces]]
    size = float(np.sqrt(np.mean(left**2)) / np.abs(observed.force).max())
    if DEEP_C10 not in ordinary.free:
        return Misfit(size, 0.0)
    equal, c10 = equally_weighted(problem, ordinary.residual), ordinary.values[DEEP_C10]
    without = [fit(equal.without(part), (), ordinary.values).values[DEEP_C10] for part in _parts(observed)]
    return Misfit(size, max((abs(value / c10 - 1.0) for value in without), default=0.0))


def _parts(observed: Observations) -> Iterator[NDArray[np.bool_]]:
    """Yield phases and thirds of the depth, those beside which enough is left."""
    third = np.minimum(observed.displacement / observed.depth * _THIRDS, _THIRDS - 1).astype(int)
    parts = [observed.phase == name for name in sorted(observed.phases)] + [third == k for k in range(_THIRDS)]
    for part in parts:
        if part.any() and np.mean(~part) > _KEPT:
            yield part[observed.nearest]

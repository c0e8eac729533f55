"""Posterior predictive checks: what a model leaves in each phase, beside what its errors would make there.

With the residual r of a phase about the model's fit and S the covariance there of all errors that the model knows of,
nuisances included, :math:`r^T S^{-1} r` is as large or larger in a share of replicated recordings: the upper tail of a
chi-square with as many degrees as readings (A. Gelman, X.-L. Meng, H. Stern, Stat. Sinica 6 (1996) 733). The parameters
were fitted to the same readings, so that the share is on the high side, and a small one says more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.stats import chi2

from legfem.inverse.explanation import Explanation


@dataclass(frozen=True)
class PhaseCheck:
    """What is left in a phase over all trials, root mean square; N."""

    phase: str
    left: float
    errors: float
    """Of all that the model knows may be off there."""
    p_value: float
    """Share of replicated recordings in which as much is left."""


def checks_by_phase(model: Explanation) -> tuple[PhaseCheck, ...]:
    """Return the checks of a model's force in each phase, in the order in which phases are recorded."""
    problem = model.problem
    observed = problem.predictor.observed
    forces = len(observed.force)
    residual, total = model.fit.residual[:forces], problem.errors.covariance[:forces, :forces]
    kept = np.ones(forces, dtype=bool) if problem.aside is None else ~problem.aside[:forces]
    found = []
    for phase in dict.fromkeys(observed.phase):
        here = np.flatnonzero((observed.phase == phase) & kept)
        if len(here):
            own = residual[here]
            square = float(own @ cho_solve(cho_factor(total[np.ix_(here, here)], lower=True), own))
            left, errors = np.sqrt(np.mean(own**2)), np.sqrt(np.mean(np.diag(total)[here]))
            found.append(PhaseCheck(str(phase), float(left), float(errors), float(chi2.sf(square, len(here)))))
    return tuple(found)

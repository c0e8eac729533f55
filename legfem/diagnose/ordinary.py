r"""The base model by ordinary least squares: as near to all recordings as it gets.

Weighed by the errors' covariance a wrong model's best fit may lie far from all data, gains and
outlines taking up what it misses (Peelle's puzzle: S. Chiba, D. L. Smith, ANL/NDM-121 (1991)).
Equal weights know no such trade: this fit is what errors are reckoned about, where searches begin,
and what is shown of a model that the recordings contradict. Its covariance is that of the errors
all the same, :math:`P (J^T \Sigma J / s^4 + I) P` with :math:`P = (J^T J / s^2 + I)^{-1}`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from legfem.common.units import FloatArray
from legfem.diagnose.fit import LinearisedFit, LinearisedProblem, fit, fit_base

_ROUNDS = 4


def ordinary_fit(problem: LinearisedProblem, starts: Sequence[Mapping[str, float]]) -> LinearisedFit:
    """Return the base model's fit with equal weights.

    Parameters
    ----------
    problem
        The observations.
    starts
        Where searches begin.
    """
    found = fit_base(equally_weighted(problem, 0.05 * problem.predictor.observed.force), starts)
    for _ in range(_ROUNDS):
        found = fit(equally_weighted(problem, found.residual), (), found.values)
    return found


def equally_weighted(problem: LinearisedProblem, misfit: FloatArray) -> LinearisedProblem:
    """Return a problem whose weights are equal, and the misfit's beside what is known."""
    errors = problem.errors
    size = max(float(np.sqrt(np.mean(misfit**2))), float(np.median(errors.trial_sd)))
    return problem.with_errors(
        replace(
            errors,
            dense=size**2 * np.eye(len(errors.trial_sd)),
            known=0.0 * errors.known,
            gains=0.0 * errors.gains,
            zeros=0.0 * errors.zeros,
        )
    )

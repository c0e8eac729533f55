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
from legfem.diagnose.explanation import Explanation
from legfem.diagnose.fit import Fit, Problem, fit, fit_base, variance_degrees
from legfem.inverse.least_squares import sandwich

_ROUNDS = 4


def ordinary_fit(problem: Problem, starts: Sequence[Mapping[str, float]]) -> Fit:
    """Return the base model's fit with equal weights.

    Parameters
    ----------
    problem
        The observations.
    starts
        Where searches begin.
    """
    found = fit_base(_equally(problem, 0.05 * problem.predictor.observed.force), starts)
    for _ in range(_ROUNDS):
        found = fit(_equally(problem, found.residual), (), found.values)
    return found


def ordinary_explanation(problem: Problem, fitted: Fit, base: Explanation) -> Explanation:
    """Return an ordinary fit as an explanation that is shown, with its intervals.

    Parameters
    ----------
    problem
        The observations with their errors.
    fitted
        By equal weights.
    base
        The base model by its errors.
    """
    same = _equally(problem, fitted.residual)
    weighed = fitted.change / np.diag(same.errors.dense)[:, None]
    own = np.eye(len(fitted.free))
    spread = np.linalg.inv(fitted.change.T @ weighed + own)
    estimator = spread @ weighed.T
    covariance = sandwich(estimator, problem.errors.covariance) + spread @ spread
    return replace(
        base,
        problem=same,
        fit=fitted,
        posterior=replace(base.posterior, mean=fitted.departure, covariance=covariance),
        degrees=variance_degrees(covariance, estimator, problem.errors, problem.causes),
    )


def _equally(problem: Problem, misfit: FloatArray) -> Problem:
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

r"""Steps, standard errors and confidence intervals of a weighted least-squares fit.

With :math:`W` the weighting and :math:`\Sigma` the covariance of the differences (recordings,
numerical error, correction), the errors of the parameters have the covariance

.. math:: V = A^{-1} J^T W \Sigma W J A^{-1}, \quad A = J^T W J.

An interval is where the profile of the cost, the other parameter refitted within its bounds, rises
by :math:`t^2 V_{kk} / (A^{-1})_{kk}`: the height at which a quadratic cost has the half-width
:math:`t \sqrt{V_{kk}}`. So it may be lopsided, and never leaves the bounds.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq, lsq_linear
from scipy.stats import t as student_t

from legfem.identify.misfit import Misfit, Prediction
from legfem.units import FloatArray


def newton_step(
    misfit: Misfit, prediction: Prediction, dimensions: int, limits: FloatArray
) -> FloatArray:
    """Return the Gauss-Newton step (p,) in kPa, within ``limits`` (p, 2)."""
    jacobian = misfit.weighted(prediction.jacobian(dimensions))
    residual = misfit.residual(prediction.force)
    scale = np.linalg.norm(jacobian, axis=0)
    low, high = (limits * scale[:, None]).T
    # lsq_linear wants its bounds apart.
    found = lsq_linear(jacobian / scale, -residual, (low - 1e-15, high + 1e-15), method="bvls")
    return np.clip(found.x / scale, limits[:, 0], limits[:, 1])


def sandwich(misfit: Misfit, jacobian: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the covariance (p, p) of the parameters' errors, kPa^2."""
    gain = gain_matrix(misfit, jacobian)
    return np.asarray(gain @ covariance @ gain.T)


def gain_matrix(misfit: Misfit, jacobian: FloatArray) -> FloatArray:
    """Return how the parameters follow the measured forces; (p, n), kPa/N."""
    weighted = misfit.weighted(jacobian)
    # Weighting is a matrix product: its transpose is had from the identity's image.
    whole = misfit.weighted(np.eye(len(jacobian)))
    return np.asarray(np.linalg.pinv(weighted) @ whole)


def quantile(repeat_dof: int) -> float:
    """Return the two-sided 95 % quantile for a covariance known from so many repeats."""
    return float(student_t.ppf(0.975, PRIOR_DOF + repeat_dof))


PRIOR_DOF = 10
"""Degrees of freedom that the instruments' stated figures are worth."""


def profile_interval(
    objective: Callable[[FloatArray], FloatArray],
    at: FloatArray,
    k: int,
    rise: float,
    bounds: FloatArray,
    scale: float,
) -> tuple[float, float]:
    """Return where the profile of an objective stays within ``rise`` of its minimum.

    Parameters
    ----------
    objective
        Of stiffnesses (n, p) in kPa.
    at
        Its minimum (p,), kPa.
    k
        Which parameter.
    rise
        Height of the cut.
    bounds
        (p, 2), kPa.
    scale
        First guess of the half-width, kPa.
    """
    least = float(objective(at[None])[0])

    def above(value: float) -> float:
        return _profile(objective, at, k, value, bounds) - least - rise

    def end(side: int) -> float:
        inner, width = float(at[k]), scale
        bound = float(bounds[k, 0] if side < 0 else bounds[k, 1])
        while inner != bound:
            outer = float(np.clip(at[k] + side * width, *bounds[k]))
            if above(outer) > 0:
                return float(brentq(above, inner, outer, xtol=1e-6 * scale))
            inner, width = outer, 1.5 * width
        return bound

    return end(-1), end(1)


def _profile(
    objective: Callable[[FloatArray], FloatArray],
    at: FloatArray,
    k: int,
    value: float,
    bounds: FloatArray,
) -> float:
    """Return the least objective with parameter k held at a value (kPa)."""
    if len(at) == 1:
        return float(objective(np.array([[value]]))[0])
    other = 1 - k
    low, high = bounds[other]
    # From the bound to well beyond the optimum, then closer and closer about the least.
    far = min(high, low + 5 * (at[other] - low) + 5 * at.sum())
    free = low + np.linspace(0.0, 1.0, 65) ** 2 * (far - low)
    for _ in range(6):
        points = np.empty((len(free), 2))
        points[:, k], points[:, other] = value, free
        costs = objective(points)
        i = int(np.argmin(costs))
        free = np.linspace(free[max(i - 1, 0)], free[min(i + 1, len(free) - 1)], 17)
    return float(costs[i])

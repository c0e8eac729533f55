"""Least squares: steps within bounds, gains, and minima of smooth residuals."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy.optimize import least_squares, lsq_linear

from legfem.common.units import FloatArray

type Residual = Callable[[FloatArray], FloatArray]
"""Weighted differences and departures (..., n) of values (..., p)."""


def gauss_newton_step(jacobian: FloatArray, residual: FloatArray, limits: FloatArray) -> FloatArray:
    """Return the Gauss-Newton step (p,).

    Parameters
    ----------
    jacobian : (n, p) array
        Of the weighted residual.
    residual : (n,) array
        Weighted.
    limits : (p, 2) array
        Least and greatest step of each parameter.
    """
    scale = np.linalg.norm(jacobian, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    low, high = (limits * scale[:, None]).T
    # lsq_linear wants its bounds apart.
    found = lsq_linear(jacobian / scale, -residual, (low - 1e-15, high + 1e-15), method="bvls")
    return np.clip(found.x / scale, limits[:, 0], limits[:, 1])


_PARALLEL = 1e-9
"""Singular values of columns of length 1, over the largest, below which two of them are as good as parallel: solves and
their derivatives are not exact beyond that."""


def inverse_in_units(jacobian: FloatArray) -> FloatArray:
    """Return the pseudo-inverse (p, m) of a Jacobian (m, p), each parameter in the unit that gives its column length 1.

    Of full rank it is the plain one. A stiffness beside the factor of an exponential may move data by 1e20 times less,
    and is no less known for that. A parameter that moves nothing has a row of zeros.
    """
    lengths = np.linalg.norm(jacobian, axis=0)
    units = np.where(lengths > 0, lengths, 1.0)
    return np.asarray(np.linalg.pinv(jacobian / units, rcond=_PARALLEL) / units[:, None])


def sandwich(gain: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the covariance (p, p) of the parameters' errors from that of the data, (n, n)."""
    return np.asarray(gain @ covariance @ gain.T)


_TO_THE_END: Mapping[str, Any] = {"xtol": 1e-12, "ftol": 1e-14, "gtol": 1e-14, "max_nfev": 60}
"""When a search ends."""


def least_residual(
    residual: Residual, start: FloatArray, bounds: FloatArray, jacobian: Residual | None = None
) -> FloatArray:
    """Return where the sum of squares of a smooth residual is least, near a start.

    Parameters
    ----------
    residual : callable
        See `Residual`; of one point at a time.
    start : (p,) array
        Within the bounds.
    bounds : (p, 2) array
        Of the values.
    jacobian : callable, optional
        Derivatives (n, p) of the residual; differences without it.
    """
    fit = least_squares(residual, start, jacobian or "3-point", tuple(bounds.T), method="dogbox", **_TO_THE_END)
    return np.asarray(fit.x)


def polished(residual: Residual, start: FloatArray) -> FloatArray:
    """Return the genes (p,), each from 0 to 1, of the least residual near a start."""
    return least_residual(residual, start, np.tile([0.0, 1.0], (len(start), 1)))


def polished_with(residual: Residual, start: FloatArray, k: int, held: float) -> FloatArray:
    """Return the same with gene k held."""
    return np.insert(polished(lambda genes: residual(np.insert(genes, k, held)), np.delete(start, k)), k, held)

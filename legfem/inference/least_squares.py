r"""Weighted least squares with priors and bounds: steps, minima, covariances.

What is minimised is

.. math:: |W (f(\theta) - y)|^2 + \sum_k u_k(\theta_k)^2

with the weighting :math:`W` and, for each parameter that has a prior, its departure :math:`u_k`
from the prior's centre in standard deviations: a prior is one more measurement. With
:math:`\Sigma` the covariance of the differences :math:`f - y`, :math:`J` their derivatives and
:math:`U` those of the departures, the errors of the parameters have the covariance

.. math:: V = A^{-1} (J^T W^T W \Sigma W^T W J + U^T U) A^{-1},
          \quad A = J^T W^T W J + U^T U,

which is :math:`A^{-1}` where the weighting is that of the errors (W. H. Greene, Econometric
Analysis, 4.5: the sandwich).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares, lsq_linear

from legfem.common.units import FloatArray
from legfem.inference.parameter import Parameter

type Residual = Callable[[FloatArray], FloatArray]
"""Weighted differences and departures (..., n) of values (..., p)."""


@dataclass(frozen=True)
class Priors:
    """The priors of parameters as further residuals, one for each parameter that has one.

    Parameters
    ----------
    parameters : tuple of Parameter
        p of them, k with a prior.
    """

    parameters: tuple[Parameter, ...]

    def __len__(self) -> int:
        """Return k."""
        return sum(one.prior is not None for one in self.parameters)

    def residual(self, values: FloatArray) -> FloatArray:
        """Return the departures (..., k), in standard deviations, of values (..., p)."""
        columns = []
        for number, parameter in enumerate(self.parameters):
            if (prior := parameter.prior) is None:
                continue
            value = values[..., number]
            if prior.scale == "log":
                columns.append(np.log(value / prior.centre) / prior.sd)
            else:
                columns.append((value - prior.centre) / prior.sd)
        return np.stack(columns, axis=-1) if columns else np.zeros((*values.shape[:-1], 0))

    def jacobian(self, values: FloatArray) -> FloatArray:
        """Return the derivatives (k, p) of the departures at values (p,)."""
        rows = np.zeros((len(self), len(self.parameters)))
        row = 0
        for number, parameter in enumerate(self.parameters):
            if (prior := parameter.prior) is None:
                continue
            scale = values[number] if prior.scale == "log" else 1.0
            rows[row, number] = 1 / (prior.sd * scale)
            row += 1
        return rows


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


def gain_matrix(jacobian: FloatArray, weighting: FloatArray) -> FloatArray:
    """Return how the parameters follow the data; (p, n).

    Parameters
    ----------
    jacobian : (m, p) array
        Of the weighted residual.
    weighting : (m, n) array
        The weighting W, with a row of its own for every prior.
    """
    return np.asarray(np.linalg.pinv(jacobian) @ weighting)


def sandwich(gain: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the covariance (p, p) of the parameters' errors from that of the data, (n, n)."""
    return np.asarray(gain @ covariance @ gain.T)


def with_unit_errors(matrix: FloatArray, count: int) -> FloatArray:
    """Return a matrix with an identity of ``count`` rows below and beside it, as priors have."""
    rows, columns = matrix.shape
    whole = np.zeros((rows + count, columns + count))
    whole[:rows, :columns] = matrix
    whole[rows:, columns:] = np.eye(count)
    return whole


def least_residual(
    residual: Residual, start: FloatArray, bounds: FloatArray, most: int = 60, jacobian: Residual | None = None
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
    most : int
        Steps at most.
    jacobian : callable, optional
        Derivatives (n, p) of the residual; differences without it.
    """
    fit = least_squares(
        residual,
        start,
        bounds=tuple(bounds.T),
        method="dogbox",
        jac=jacobian or "3-point",
        xtol=1e-12,
        ftol=1e-14,
        gtol=1e-14,
        max_nfev=most,
    )
    return np.asarray(fit.x)

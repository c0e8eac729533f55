r"""A smooth stand-in for a model, through its solved values and exact derivatives.

Of :math:`\ln F(d_i)` at all grid points :math:`d_i` at once, by kriging; of what may have either sign as it is, over
its size.

Gradient-enhanced kriging of many quantities at once, in any number of coordinates, about a linear
trend, with a squared-exponential covariance whose lengths (one a coordinate) are those of the
greatest likelihood (A. I. J. Forrester, A. Sóbester, A. J. Keane, Engineering Design via Surrogate
Modelling, 2008, 7.2). Coordinates are to be such that a change by 1 is a large one: the logarithm
of a stiffness.
"""

import math
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PPoly
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.optimize import minimize

from legfem.common.units import FloatArray

_LENGTHS = (0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6)
# Up to here all combinations of these lengths are tried; above, an optimiser looks for them.
_FEW = 2


class Kriging:
    """Quantities anywhere.

    Parameters
    ----------
    at : (n, p) array
        Coordinates; at least one place, through which alone all is linear.
    values : (n, m) array
        There.
    slopes : (n, p, m) array
        Derivatives of the values by the coordinates.
    nugget : float
        By how much samples may contradict each other: a variance over the process'.
    """

    def __init__(self, at: FloatArray, values: FloatArray, slopes: FloatArray, nugget: float) -> None:
        self._at, self._nugget = at, nugget
        self._values = np.vstack([values, *(slopes[:, j, :] for j in range(self.dimensions))])
        self._trend = _trend(at)

    @property
    def dimensions(self) -> int:
        """Number of coordinates."""
        return int(self._at.shape[1])

    def __call__(self, at: FloatArray) -> FloatArray:
        """Return the values (..., m) at coordinates (..., p)."""
        flat = at.reshape(math.prod(at.shape[:-1]), self.dimensions)
        values = _covariance(flat, self._at, self._fit.lengths) @ self._fit.weights
        values += self._fit.trend[0] + flat @ self._fit.trend[1:]
        return values.reshape(*at.shape[:-1], values.shape[-1])

    @property
    def size(self) -> int:
        """Number m of quantities."""
        return int(self._values.shape[1])

    def part(self, columns: Sequence[int] | NDArray[np.int_]) -> "Kriging":
        """Return the kriging of some of the quantities, with the covariance of all."""
        found, fit = copy(self), self._fit
        found._values = self._values[:, columns]
        found._fit = replace(fit, weights=fit.weights[:, columns], trend=fit.trend[:, columns])
        return found

    @cached_property
    def _fit(self) -> "_Fit":
        if self.dimensions <= _FEW:
            every = product(_LENGTHS, repeat=self.dimensions)
            fits = [self._fitted(np.array(lengths)) for lengths in every]
            return max(fits, key=lambda fit: fit.log_likelihood)
        alike = [self._fitted(np.full(self.dimensions, length)) for length in _LENGTHS]
        start = max(alike, key=lambda fit: fit.log_likelihood)
        bounds = [(np.log(_LENGTHS[0]), np.log(_LENGTHS[-1]))] * self.dimensions
        found = minimize(
            lambda logs: -self._likelihood(np.exp(logs)),
            np.log(start.lengths),
            method="L-BFGS-B",
            bounds=bounds,
            options={"maxiter": 40},
        )
        return max(start, self._fitted(np.exp(found.x)), key=lambda fit: fit.log_likelihood)

    def _likelihood(self, lengths: FloatArray) -> float:
        try:
            return self._fitted(lengths).log_likelihood
        except LinAlgError:
            return -1e12

    def _fitted(self, lengths: FloatArray) -> "_Fit":
        covariance = _covariance_of_samples(self._at, lengths)
        covariance += self._nugget * np.eye(len(covariance))
        factor = cho_factor(covariance, lower=True)
        whitened = cho_solve(factor, self._trend)
        normal = self._trend.T @ whitened
        trend = np.linalg.solve(normal, whitened.T @ self._values)
        rest = self._values - self._trend @ trend
        weights = cho_solve(factor, rest)
        n, m = self._values.shape
        variance = max(float(np.sum(rest * weights)) / (n * m), 1e-300)
        log_determinant = 2 * float(np.sum(np.log(np.diag(factor[0]))))
        return _Fit(lengths, weights, trend, -n * np.log(variance) - log_determinant)


@dataclass(frozen=True, eq=False)
class _Fit:
    lengths: FloatArray
    weights: FloatArray
    trend: FloatArray
    log_likelihood: float


def _trend(at: FloatArray) -> FloatArray:
    """Return what values, and then derivatives, at places (n, p) take of a linear trend."""
    n, p = at.shape
    slopes = [np.tile(np.eye(p + 1)[j + 1], (n, 1)) for j in range(p)]
    return np.vstack([np.hstack([np.ones((n, 1)), at]), *slopes])


def _covariance(at: FloatArray, samples: FloatArray, lengths: FloatArray) -> FloatArray:
    """Return the covariance of values at places (q, p) with values and derivatives at samples (n, p)."""
    apart = (at[:, None, :] - samples) / lengths
    k = np.exp(-0.5 * np.vecdot(apart, apart))
    slopes = (apart / lengths * k[..., None]).transpose(0, 2, 1)
    return np.concatenate([k, slopes.reshape(len(at), samples.size)], axis=1)


def _covariance_of_samples(samples: FloatArray, lengths: FloatArray) -> FloatArray:
    """Return the covariance of values and derivatives at samples (n, p) with each other."""
    (n, p), values = samples.shape, _covariance(samples, samples, lengths)
    apart = (samples[:, None, :] - samples) / lengths**2
    slopes = (np.diag(1 / lengths**2) - apart[..., None] * apart[..., None, :]) * values[:, :n, None, None]
    of_slopes = slopes.transpose(2, 0, 3, 1).reshape(n * p, n * p)
    return np.vstack([values, np.hstack([values[:, n:].T, of_slopes])])


# The solved curve is a spline through adaptive steps, so that it is smooth in the stiffness to some
# 1e-4 only; less makes neighbouring samples contradict each other.
NUGGET = 1e-8
_SMALLEST_FORCE_N = 1e-9


type LinearScale = FloatArray | float
"""Sizes (m,) of what may have either sign; 0 for forces along the travel, or where all are such."""


class Emulator:
    """Force on a grid of displacement anywhere, from solved samples.

    Parameters
    ----------
    at : (n, p) array
        Coordinates; at least one place, through which alone ln F is linear in the coordinates.
    force : (n, m) array
        N.
    by : (n, p, m) array
        Derivatives of the force by the coordinates (N).
    linear_scale : (m,) array
        Sizes of those that may have either sign, in the unit that they have in the place of N; 0 for forces.
    """

    def __init__(self, at: FloatArray, force: FloatArray, by: FloatArray, linear_scale: LinearScale = 0.0) -> None:
        self._linear, self._size = np.greater(linear_scale, 0), linear_scale
        least, size = np.maximum(force, _SMALLEST_FORCE_N), np.where(self._linear, linear_scale, 1.0)
        values = np.where(self._linear, force / size, np.log(least))
        self._log_force = Kriging(at, values, by / np.where(self._linear, size, least)[:, None, :], NUGGET)

    def __call__(self, at: FloatArray) -> FloatArray:
        """Return the force (..., m) in N at coordinates (..., p)."""
        found = self._log_force(at)
        # Far outside the samples the trend may run away.
        return np.where(self._linear, self._size * found, np.exp(np.clip(found, -30.0, 30.0)))


type At = Callable[[FloatArray], FloatArray]
"""Courses (m + 1, k), at zero and at a grid, to what they are at displacements (n, k)."""


@dataclass(frozen=True, eq=False)
class GridSpline:
    """Makes splines through values at zero and at a grid's m displacements.

    Parameters
    ----------
    grid
        (m,), mm, rising from above zero.
    """

    grid: FloatArray

    @cached_property
    def _knots(self) -> FloatArray:
        return np.concatenate([[0.0], self.grid])

    @cached_property
    def _coefficients(self) -> FloatArray:
        """Of every piece by the values, (4 m, m + 1), the cubic ones of all pieces first."""
        return CubicSpline(self._knots, np.eye(len(self._knots))).c.reshape(-1, len(self._knots)).copy()

    def through(self, courses: FloatArray) -> PPoly:
        """Return the splines through courses (m + 1, ...)."""
        pieces = (self._coefficients @ courses).reshape(4, len(self.grid), *courses.shape[1:])
        return PPoly.construct_fast(pieces, self._knots)

    def at(self, displacement: FloatArray) -> At:
        """Return what evaluates courses (m + 1, k) at displacements (n,), as (n, k); below zero as at zero."""
        inside = np.maximum(displacement, 0.0)
        return lambda courses: np.asarray(self.through(courses)(inside))

"""A smooth stand-in for one metric over the coded factors, and how far off it is."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from legfem.common.units import FloatArray

_STARTS = (0.8, 2.0, 5.0)
_LENGTHS = (0.2, 30.0)
_NUGGETS = (1e-10, 1e-1)


class MetricEmulator:
    """Kriging about a full quadratic, with one length a factor.

    The squared-exponential covariance's lengths and its nugget are those of the greatest
    likelihood.

    Parameters
    ----------
    at : ndarray
        (n, k), coded.
    values : ndarray
        (n,).
    """

    def __init__(self, at: FloatArray, values: FloatArray) -> None:
        self.at = at
        self._mean, self._scale = float(values.mean()), float(values.std()) or 1.0
        self._values = (values - self._mean) / self._scale
        # A quadratic needs more points than it has coefficients.
        self._squares = len(values) > 2 * _terms(at[:1], True).shape[1]
        self._trend_at = _terms(at, self._squares)
        k = at.shape[1]
        bounds = [tuple(np.log(_LENGTHS))] * k + [tuple(np.log(_NUGGETS))]
        fits = [
            minimize(self._cost, np.log([start] * k + [1e-6]), method="L-BFGS-B", bounds=bounds) for start in _STARTS
        ]
        best = min(fits, key=lambda fit: float(fit.fun))
        self._solve(best.x)

    def __call__(self, at: FloatArray) -> FloatArray:
        """Return the metric at coded points (m, k)."""
        smooth = _covariance(at, self.at, self._lengths) @ self._weights
        standard = _terms(at, self._squares) @ self._trend + smooth
        return np.asarray(self._mean + self._scale * standard)

    def _cost(self, logs: FloatArray) -> float:
        try:
            return self._solve(logs)
        except np.linalg.LinAlgError:
            return 1e10

    def _solve(self, logs: FloatArray) -> float:
        """Fit with given lengths and nugget; return -2 ln of their likelihood."""
        self._lengths = np.exp(logs[:-1])
        covariance = _covariance(self.at, self.at, self._lengths)
        covariance += np.exp(logs[-1]) * np.eye(len(self.at))
        factor = cho_factor(covariance, lower=True)
        whitened = cho_solve(factor, self._trend_at)
        self._trend = np.linalg.solve(self._trend_at.T @ whitened, whitened.T @ self._values)
        rest = self._values - self._trend_at @ self._trend
        self._weights = cho_solve(factor, rest)
        n = len(rest)
        variance = max(float(rest @ self._weights) / n, 1e-300)
        return n * np.log(variance) + 2 * float(np.log(np.diag(factor[0])).sum())


@dataclass(frozen=True)
class EmulatorError:
    """How far an emulator is from simulations that it hasn't seen."""

    points: int
    rms: float
    """In the metric's unit."""
    relative: float
    """rms over the standard deviation of the simulations."""

    @property
    def explained(self) -> float:
        """Share of the simulations' variance that the emulator explains."""
        return 1 - self.relative**2


def emulator_error(emulator: MetricEmulator, at: FloatArray, values: FloatArray) -> EmulatorError:
    """Return the error at simulated points (n, k)."""
    rms = float(np.sqrt(np.mean((emulator(at) - values) ** 2)))
    return EmulatorError(len(values), rms, rms / float(values.std()))


def _terms(at: FloatArray, squares: bool) -> FloatArray:
    pairs = combinations(range(at.shape[1]), 2)
    products = [at[:, i] * at[:, j] for i, j in pairs]
    columns = [np.ones(len(at)), *at.T, *products]
    return np.column_stack([*columns, *(at.T**2)] if squares else columns)


def _covariance(a: FloatArray, b: FloatArray, lengths: FloatArray) -> FloatArray:
    apart = a[:, None, :] / lengths - b[None, :, :] / lengths
    return np.asarray(np.exp(-0.5 * np.sum(apart**2, axis=-1)))

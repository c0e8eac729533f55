"""Variance-based sensitivity of a metric over the whole range, by SALib on an emulator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pandas as pd
from SALib.analyze import sobol as sobol_analysis
from SALib.sample import sobol as sobol_sample
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from legfem.common.units import FloatArray
from legfem.study.doe.design import Factor
from legfem.study.doe.runs import Metric

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


_BASE_SAMPLES = 2048
_ENOUGH = 5


@dataclass(frozen=True, eq=False)
class SobolIndices:
    """Shares of a metric's variance, the factors uniform in their coded ranges."""

    metric: Metric
    first: FloatArray
    """(k,): by a factor alone."""
    first_ci95: FloatArray
    """(k,): half-width, of the sampling."""
    total: FloatArray
    """(k,): with all its interactions."""
    total_ci95: FloatArray
    error: EmulatorError
    predicted: FloatArray
    """(m,), of the test simulations."""
    simulated: FloatArray
    """(m,)."""


def sobol_indices(
    learn: pd.DataFrame, test: pd.DataFrame, factors: tuple[Factor, ...], metric: Metric, seed: int
) -> SobolIndices | None:
    """Return the indices; None where too few simulations have the metric."""
    symbols = [f.symbol for f in factors]
    learn, test = learn[np.isfinite(learn[metric.name])], test[np.isfinite(test[metric.name])]
    if len(learn) < 4 * len(factors) or len(test) < _ENOUGH:
        return None
    emulator = MetricEmulator(coordinates(factors, learn[symbols].to_numpy(float)), learn[metric.name].to_numpy(float))
    at = coordinates(factors, test[symbols].to_numpy(float))
    simulated = test[metric.name].to_numpy(float)
    found = sobol_of(lambda coded: emulator(coordinates(factors, coded)), symbols, seed)
    return SobolIndices(
        metric,
        np.asarray(found["S1"]),
        np.asarray(found["S1_conf"]),
        np.asarray(found["ST"]),
        np.asarray(found["ST_conf"]),
        emulator_error(emulator, at, simulated),
        emulator(at),
        simulated,
    )


def coordinates(factors: tuple[Factor, ...], coded: FloatArray) -> FloatArray:
    """Return where an emulator sees coded points (n, k).

    Over a linear range of several tens the metrics bend near its lower end: the square root of the
    value, scaled to -1..1, spreads that end out. A logarithmic coding has done so already.
    """
    columns = []
    for column, factor in zip(coded.T, factors, strict=True):
        if factor.coding == "linear":
            low, high = np.sqrt(factor.low), np.sqrt(factor.high)
            value = factor.low + (factor.high - factor.low) * (column + 1) / 2
            columns.append(2 * (np.sqrt(value) - low) / (high - low) - 1)
        else:
            columns.append(column)
    return np.column_stack(columns)


def sobol_of(function: Callable[[FloatArray], FloatArray], symbols: list[str], seed: int) -> dict[str, FloatArray]:
    """Return SALib's indices of a function of coded points (n, k)."""
    problem = {"num_vars": len(symbols), "names": symbols, "bounds": [[-1.0, 1.0]] * len(symbols)}
    sample = sobol_sample.sample(problem, _BASE_SAMPLES, calc_second_order=False, seed=seed)
    values = np.concatenate([function(part) for part in np.array_split(sample, 16)])
    # The estimators lose digits where the mean is large beside the spread.
    values = (values - values.mean()) / values.std()
    found = sobol_analysis.analyze(problem, values, calc_second_order=False, seed=seed)
    return {name: np.asarray(found[name]) for name in ("S1", "S1_conf", "ST", "ST_conf")}

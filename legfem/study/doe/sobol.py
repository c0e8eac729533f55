"""Variance-based sensitivity of a metric over the whole range, by SALib on an emulator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from SALib.analyze import sobol as sobol_analysis
from SALib.sample import sobol as sobol_sample

from legfem.common.units import FloatArray
from legfem.study.doe.emulator import EmulatorError, MetricEmulator, emulator_error
from legfem.study.doe.factors import Factor
from legfem.study.doe.metrics import Metric

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

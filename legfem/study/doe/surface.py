"""The response surface (Eq. 4): intercept, main effects and two-factor interactions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import statsmodels.formula.api as smf

from legfem.common.units import FloatArray
from legfem.study.doe.factors import Factor
from legfem.study.doe.metrics import Metric


@dataclass(frozen=True, eq=False)
class Surface:
    """A fitted surface of one metric.

    ``fit`` is statsmodels' own result, with 1 + k + k (k - 1) / 2 coefficients.
    """

    metric: Metric
    factors: tuple[Factor, ...]
    formula: str
    fit: Any
    missing: tuple[int, ...]
    """Numbers of the runs that haven't."""

    @property
    def coefficients(self) -> pd.Series[float]:
        """By the formula's terms."""
        return self.fit.params

    @property
    def residuals(self) -> FloatArray:
        """(n,), of the runs used."""
        return np.asarray(self.fit.resid)

    @property
    def response(self) -> FloatArray:
        """(n,), of the runs used."""
        return np.asarray(self.fit.model.endog)


class NotEstimableError(Exception):
    """The runs that are there don't determine the surface."""


def surface_formula(metric: Metric, factors: tuple[Factor, ...]) -> str:
    """Return Eq. 4 as a formula of statsmodels."""
    return f"{metric.name} ~ ({' + '.join(f.symbol for f in factors)})**2"


def fit_surface(table: pd.DataFrame, factors: tuple[Factor, ...], metric: Metric) -> Surface:
    """Fit the surface to the runs that have the metric.

    Raises
    ------
    NotEstimableError
        If too few runs have it, or if those that have confound coefficients.
    """
    has = np.isfinite(table[metric.name].to_numpy(dtype=float))
    missing = tuple(int(number) for number in table["run"][~has])
    coefficients = 1 + len(factors) + len(factors) * (len(factors) - 1) // 2
    if has.sum() <= coefficients:
        raise NotEstimableError(f"{has.sum()} runs have it, {coefficients} coefficients need more")
    formula = surface_formula(metric, factors)
    fit = smf.ols(formula, table[has]).fit()
    if np.linalg.matrix_rank(fit.model.exog) < coefficients:
        raise NotEstimableError(f"without runs {_listed(missing)} some coefficients are confounded")
    return Surface(metric, factors, formula, fit, missing)


def term_label(term: str, factors: tuple[Factor, ...]) -> str:
    """Return a formula's term as people read it."""
    labels = {f.symbol: f.label for f in factors}
    return " x ".join(labels.get(part, part) for part in term.split(":"))


def _listed(numbers: tuple[int, ...]) -> str:
    return ", ".join(map(str, numbers))

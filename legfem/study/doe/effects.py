"""Effects without an error estimate: Lenth's method, centre-point curvature, normality.

The runs are deterministic, so that nothing in them repeats: the surface's residual is lack of fit.
Lenth's pseudo standard error takes the small ones among all 2^k - 1 contrasts for noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pandas as pd
from scipy.stats import norm, shapiro
from scipy.stats import t as student
from statsmodels.stats.diagnostic import lilliefors

from legfem.common.units import FloatArray
from legfem.study.doe.factors import Factor
from legfem.study.doe.metrics import Metric
from legfem.study.doe.surface import Surface


@dataclass(frozen=True, eq=False)
class Lenth:
    """All contrasts of a two-level factorial, as coefficients (half of the effects)."""

    terms: tuple[str, ...]
    values: FloatArray
    pseudo_standard_error: float
    margin: float
    """Margin of error: 95 % for one contrast."""
    simultaneous_margin: float
    """95 % for all contrasts together."""

    @property
    def half_normal(self) -> tuple[FloatArray, FloatArray, list[str]]:
        """Quantiles, absolute values and terms, in increasing order."""
        order = np.argsort(np.abs(self.values))
        ranks = (np.arange(len(order)) + 0.5) / len(order)
        return norm.ppf(0.5 + 0.5 * ranks), np.abs(self.values)[order], [self.terms[k] for k in order]


@dataclass(frozen=True)
class CentreCurvature:
    """Mean of the corners less the centre: 0 for any surface without squares."""

    difference: float
    relative: float
    """To the largest coefficient."""
    share_of_sse: float
    """Share of the surface's SSE (all runs there) that the centre alone makes."""
    t: float
    """With Lenth's pseudo standard error, (2^k - 1) / 3 degrees of freedom."""
    p_value: float


@dataclass(frozen=True)
class Normality:
    """Probabilities of samples as far from normal, were they normal."""

    shapiro: float
    lilliefors: float


def lenth(table: pd.DataFrame, factors: tuple[Factor, ...], metric: Metric) -> Lenth | None:
    """Return all contrasts of the corners; None where a corner is missing."""
    corners = table[: 2 ** len(factors)]
    response = corners[metric.name].to_numpy(dtype=float)
    if len(response) < 2 ** len(factors) or not np.isfinite(response).all():
        return None
    symbols = [f.symbol for f in factors]
    coded = {s: corners[s].to_numpy(dtype=float) for s in symbols}
    terms, values = [], []
    for order in range(1, len(symbols) + 1):
        for group in combinations(symbols, order):
            signs = np.prod([coded[s] for s in group], axis=0)
            terms.append(":".join(group))
            values.append(float(np.mean(signs * response)))
    return lenth_of(tuple(terms), np.array(values))


def lenth_of(terms: tuple[str, ...], values: FloatArray) -> Lenth:
    """Return Lenth's limits of contrasts (Technometrics 31, 1989)."""
    size = np.abs(values)
    first = 1.5 * float(np.median(size))
    small = size[size < 2.5 * first]
    pse = 1.5 * float(np.median(small)) if len(small) else first
    m = len(values)
    margin = float(student.ppf(0.975, m / 3)) * pse
    together = float(student.ppf((1 + 0.95 ** (1 / m)) / 2, m / 3)) * pse
    return Lenth(terms, values, pse, margin, together)


def centre_curvature(table: pd.DataFrame, metric: Metric, found: Lenth, surface: Surface) -> CentreCurvature | None:
    """Return the test for squares; None where the centre is missing."""
    n = len(found.values) + 1
    response = table[metric.name].to_numpy(dtype=float)
    if len(response) <= n or not np.isfinite(response[n]):
        return None
    difference = float(response[:n].mean() - response[n])
    # A contrast has 1/n of a run's variance.
    error = found.pseudo_standard_error * np.sqrt(n * (1 / n + 1))
    t = difference / error if error > 0 else np.inf
    return CentreCurvature(
        difference,
        difference / float(np.abs(found.values).max()),
        difference**2 * n / (n + 1) / float(surface.fit.ssr),
        float(t),
        float(2 * student.sf(abs(t), (n - 1) / 3)),
    )


def normality(values: FloatArray) -> Normality:
    """Return the tests of Shapiro and Wilk, and of Lilliefors."""
    return Normality(float(shapiro(values).pvalue), float(lilliefors(values, "norm")[1]))


def omitted_terms(found: Lenth, surface: Surface) -> list[str]:
    """Return the terms beyond the surface whose contrasts exceed the simultaneous margin."""
    inside = set(surface.coefficients.index)
    return [
        term
        for term, value in zip(found.terms, found.values, strict=True)
        if term not in inside and abs(value) > found.simultaneous_margin
    ]

"""The response surface (Eq. 4), its analysis of variance (Eq. 5 to 11), and effects without an error estimate.

The runs are deterministic, so that nothing in them repeats: the surface's residual is lack of fit.
Lenth's pseudo standard error takes the small ones among all 2^k - 1 contrasts for noise.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
import statsmodels.formula.api as smf
from scipy import stats
from statsmodels.stats.diagnostic import lilliefors

from legfem.common.units import FloatArray
from legfem.study.doe.design import Factor
from legfem.study.doe.runs import Metric

LEVEL = 0.05


@dataclass(frozen=True)
class Anova:
    """One row of the paper's Table 3 (Eq. 5 to 10); ``predicted_r_squared`` is 1 - PRESS / SST."""

    ssr: float
    msr: float
    sse: float
    mse: float
    r_squared: float
    predicted_r_squared: float
    F: float
    p_value: float
    model_dof: int
    error_dof: int


@dataclass(frozen=True)
class CoefficientTest:
    """One coefficient and its t test (Eq. 11)."""

    term: str
    value: float
    standard_error: float
    t: float
    p_value: float

    @property
    def significant(self) -> bool:
        """Whether it is significant at 5 %."""
        return self.p_value <= LEVEL

    @property
    def is_interaction(self) -> bool:
        """Whether two factors make it."""
        return ":" in self.term


@dataclass(frozen=True, eq=False)
class Lenth:
    """All contrasts of a two-level factorial, as coefficients (half of the effects).

    Attributes
    ----------
    margin : float
        Margin of error: 95 % for one contrast.
    simultaneous_margin : float
        95 % for all contrasts together.
    """

    terms: tuple[str, ...]
    values: FloatArray
    pseudo_standard_error: float
    margin: float
    simultaneous_margin: float

    @property
    def beyond(self) -> list[str]:
        """Terms whose contrasts exceed the simultaneous margin."""
        return [t for t, v in zip(self.terms, self.values, strict=True) if abs(v) > self.simultaneous_margin]


@dataclass(frozen=True)
class CentreCurvature:
    """Mean of the corners less the centre: 0 for any surface without squares.

    Attributes
    ----------
    relative : float
        Over the largest coefficient.
    share_of_sse : float
        Share of the surface's SSE (all runs there) that the centre alone makes.
    t : float
        With Lenth's pseudo standard error, (2^k - 1) / 3 degrees of freedom.
    """

    difference: float
    relative: float
    share_of_sse: float
    t: float
    p_value: float


@dataclass(frozen=True)
class Normality:
    """Probabilities of samples as far from normal, were they normal."""

    shapiro: float
    lilliefors: float


@dataclass(frozen=True, eq=False)
class MetricAnalysis:
    """All that the factorial says of one metric: intercept, main effects and two-factor interactions; all contrasts.

    Attributes
    ----------
    fit : statsmodels.regression.linear_model.RegressionResults
        With 1 + k + k (k - 1) / 2 coefficients.
    missing : tuple of int
        Numbers of the runs that lack the metric.
    lenth : Lenth, optional
        None where a corner is missing.
    centre : CentreCurvature, optional
        None where a corner or the centre is missing.
    """

    metric: Metric
    fit: Any
    missing: tuple[int, ...]
    lenth: Lenth | None
    centre: CentreCurvature | None

    @cached_property
    def anova(self) -> Anova:
        """Analysis of variance; the degrees of freedom are those of the runs used."""
        fit, influence = self.fit, self.fit.get_influence()
        press = float(influence.ess_press) if influence.hat_matrix_diag.max() < 1 else np.nan
        ssr, msr, sse, mse, F = map(float, (fit.ess, fit.mse_model, fit.ssr, fit.mse_resid, fit.fvalue))
        predicted = 1 - press / float(fit.centered_tss)
        dof = int(fit.df_model), int(fit.df_resid)
        return Anova(ssr, msr, sse, mse, float(fit.rsquared), predicted, F, float(fit.f_pvalue), *dof)

    @cached_property
    def tests(self) -> tuple[CoefficientTest, ...]:
        """Student's tests of the coefficients, the intercept first."""
        fit = self.fit
        columns = (column.tolist() for column in (fit.params.index, fit.params, fit.bse, fit.tvalues, fit.pvalues))
        return tuple(CoefficientTest(*row) for row in zip(*columns, strict=True))

    def main(self, prefix: str = "") -> list[CoefficientTest]:
        """Main effects whose factor's symbol begins like this."""
        return [test for test in self.tests[1:] if not test.is_interaction and test.term.startswith(prefix)]

    def interactions(self) -> list[CoefficientTest]:
        """Two-factor interactions."""
        return [test for test in self.tests if test.is_interaction]

    def shares(self) -> tuple[dict[str, float], float]:
        """Shares of the metric's variation that the factors make, by symbol, and that interactions make.

        Squares of the coded coefficients over their sum: the sums of squares of an orthogonal design.
        """
        total = sum(test.value**2 for test in self.tests[1:]) or 1.0
        main = {test.term: test.value**2 / total for test in self.main()}
        return main, 1.0 - sum(main.values())

    @cached_property
    def outputs(self) -> Normality:
        """Whether the metric is normal."""
        return normality(self.fit.model.endog)

    @cached_property
    def residuals(self) -> Normality:
        """Whether the surface's residuals are normal."""
        return normality(np.asarray(self.fit.resid))


class NotEstimableError(Exception):
    """The runs that are there don't determine the surface."""


def analyse_metric(table: pd.DataFrame, factors: tuple[Factor, ...], metric: Metric) -> MetricAnalysis:
    """Fit the surface to the runs that have the metric, and look at all contrasts.

    p in n - p and p - 1 is the number of coefficients (16 for five factors), as in the paper's Table 3. Its text says
    5, which explains none of the table's rows.

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
    model = smf.ols(f"{metric.name} ~ ({' + '.join(f.symbol for f in factors)})**2", table[has])
    if np.linalg.matrix_rank(model.exog) < coefficients:
        raise NotEstimableError(f"without runs {', '.join(map(str, missing))} some coefficients are confounded")
    fit, contrasts = model.fit(), lenth(table, factors, metric)
    centre = None if contrasts is None else centre_curvature(table, metric, contrasts, float(fit.ssr))
    return MetricAnalysis(metric, fit, missing, contrasts, centre)


def term_label(term: str, factors: tuple[Factor, ...]) -> str:
    """Term of a formula as people read it."""
    labels = {f.symbol: f.label for f in factors}
    return " x ".join(labels.get(part, part) for part in term.split(":"))


def lenth(table: pd.DataFrame, factors: tuple[Factor, ...], metric: Metric) -> Lenth | None:
    """All contrasts of the corners; None where a corner is missing."""
    corners = table[: 2 ** len(factors)]
    response = corners[metric.name].to_numpy(dtype=float)
    if len(response) < 2 ** len(factors) or not np.isfinite(response).all():
        return None
    groups = [g for order in range(1, len(factors) + 1) for g in combinations([f.symbol for f in factors], order)]
    contrasts = [float(np.mean(corners[list(g)].to_numpy(dtype=float).prod(axis=1) * response)) for g in groups]
    return lenth_of(tuple(":".join(group) for group in groups), np.array(contrasts))


def lenth_of(terms: tuple[str, ...], values: FloatArray) -> Lenth:
    """Lenth's limits of contrasts (Technometrics 31, 1989)."""
    size = np.abs(values)
    first = 1.5 * float(np.median(size))
    small = size[size < 2.5 * first]
    pse = 1.5 * float(np.median(small)) if len(small) else first
    m = len(values)
    margin, together = (float(stats.t.ppf(at, m / 3)) * pse for at in (0.975, (1 + 0.95 ** (1 / m)) / 2))
    return Lenth(terms, values, pse, margin, together)


def centre_curvature(table: pd.DataFrame, metric: Metric, found: Lenth, sse: float) -> CentreCurvature | None:
    """Test for squares; None where the centre is missing."""
    n = len(found.values) + 1
    response = table[metric.name].to_numpy(dtype=float)
    if len(response) <= n or not np.isfinite(response[n]):
        return None
    difference = float(response[:n].mean() - response[n])
    # A contrast has 1/n of a run's variance.
    error = found.pseudo_standard_error * np.sqrt(n * (1 / n + 1))
    t = float(difference / error) if error > 0 else np.inf
    relative = difference / float(np.abs(found.values).max())
    share = difference**2 * n / (n + 1) / sse
    return CentreCurvature(difference, relative, share, t, float(2 * stats.t.sf(abs(t), (n - 1) / 3)))


def normality(values: FloatArray) -> Normality:
    """Tests of Shapiro and Wilk, and of Lilliefors."""
    return Normality(float(stats.shapiro(values).pvalue), float(lilliefors(values, "norm")[1]))

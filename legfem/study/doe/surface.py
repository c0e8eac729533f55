"""The response surface (Eq. 4), its analysis of variance (Eq. 5 to 11), and effects without an error estimate.

The runs are deterministic, so that nothing in them repeats: the surface's residual is lack of fit.
Lenth's pseudo standard error takes the small ones among all 2^k - 1 contrasts for noise.
"""

from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal

import numpy as np
import pandas as pd
import statsmodels.formula.api as smf
from scipy.stats import f as fisher
from scipy.stats import shapiro
from scipy.stats import t as student
from statsmodels.stats.diagnostic import lilliefors

from legfem.common.units import FloatArray
from legfem.study.doe.design import Factor
from legfem.study.doe.runs import Metric

Counting = Literal["coefficients", "factors"]
"""What p is in n - p and p - 1: the surface's coefficients (16 for five factors), which is right
and what Table 3 used, or the factors (5), as in the paper's text."""

LEVEL = 0.05


@dataclass(frozen=True, eq=False)
class Surface:
    """Intercept, main effects and two-factor interactions of one metric.

    Attributes
    ----------
    fit : statsmodels.regression.linear_model.RegressionResults
        With 1 + k + k (k - 1) / 2 coefficients.
    missing : tuple of int
        Numbers of the runs that lack the metric.
    """

    metric: Metric
    factors: tuple[Factor, ...]
    formula: str
    fit: Any
    missing: tuple[int, ...]

    @property
    def coefficients(self) -> "pd.Series[float]":
        """Coefficients by the formula's terms."""
        return self.fit.params

    @property
    def residuals(self) -> FloatArray:
        """Residuals (n,) of the runs used."""
        return np.asarray(self.fit.resid)

    @property
    def response(self) -> FloatArray:
        """Metric (n,) of the runs used."""
        return np.asarray(self.fit.model.endog)


class NotEstimableError(Exception):
    """The runs that are there don't determine the surface."""


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
    formula = f"{metric.name} ~ ({' + '.join(f.symbol for f in factors)})**2"
    fit = smf.ols(formula, table[has]).fit()
    if np.linalg.matrix_rank(fit.model.exog) < coefficients:
        raise NotEstimableError(f"without runs {', '.join(map(str, missing))} some coefficients are confounded")
    return Surface(metric, factors, formula, fit, missing)


def term_label(term: str, factors: tuple[Factor, ...]) -> str:
    """Term of a formula as people read it."""
    labels = {f.symbol: f.label for f in factors}
    return " x ".join(labels.get(part, part) for part in term.split(":"))


@dataclass(frozen=True)
class Anova:
    """One row of the paper's Table 3; ``predicted_r_squared`` is 1 - PRESS / SST."""

    ssr: float
    sse: float
    model_dof: int
    error_dof: int
    predicted_r_squared: float

    @property
    def msr(self) -> float:
        """Mean square of the regression (Eq. 8)."""
        return self.ssr / self.model_dof

    @property
    def mse(self) -> float:
        """Mean square of the error (Eq. 7)."""
        return self.sse / self.error_dof

    @property
    def r_squared(self) -> float:
        """SSR / SST (Eq. 9)."""
        return self.ssr / (self.ssr + self.sse)

    @property
    def F(self) -> float:
        """MSR / MSE (Eq. 10)."""
        return self.msr / self.mse if self.mse > 0 else np.inf

    @property
    def p_value(self) -> float:
        """Probability of an F as large, were there no effects."""
        return float(fisher.sf(self.F, self.model_dof, self.error_dof))


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


def anova(surface: Surface, counting: Counting = "coefficients") -> Anova:
    """Analysis of variance; the degrees of freedom are those of the runs used."""
    fit = surface.fit
    p = len(surface.coefficients) if counting == "coefficients" else len(surface.factors)
    influence = fit.get_influence()
    press = float(influence.ess_press) if influence.hat_matrix_diag.max() < 1 else np.nan
    return Anova(float(fit.ess), float(fit.ssr), p - 1, int(fit.nobs) - p, 1 - press / float(fit.centered_tss))


def coefficient_tests(surface: Surface, counting: Counting = "coefficients") -> tuple[CoefficientTest, ...]:
    r"""Test the coefficients, the intercept first.

    .. math:: t = \beta / \sqrt{MSE\, [(X^T X)^{-1}]_{ii}},

    which is the square root of MSE/32 for effects and of MSE/33 for the intercept of 33 runs.
    """
    table = anova(surface, counting)
    values = surface.coefficients.to_numpy()
    spread = np.sqrt(table.mse * np.diag(surface.fit.normalized_cov_params))
    t = np.divide(values, spread, out=np.full(len(values), np.inf), where=spread > 0)
    columns = (column.tolist() for column in (values, spread, t, 2 * student.sf(np.abs(t), table.error_dof)))
    return tuple(CoefficientTest(*row) for row in zip(map(str, surface.coefficients.index), *columns, strict=True))


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

    def omitted_from(self, surface: Surface) -> list[str]:
        """Terms beyond the surface whose contrasts exceed the simultaneous margin."""
        beyond = np.abs(self.values) > self.simultaneous_margin
        return [
            t for t, is_beyond in zip(self.terms, beyond, strict=True) if is_beyond and t not in surface.coefficients
        ]


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
    margin, together = (float(student.ppf(at, m / 3)) * pse for at in (0.975, (1 + 0.95 ** (1 / m)) / 2))
    return Lenth(terms, values, pse, margin, together)


def centre_curvature(table: pd.DataFrame, metric: Metric, found: Lenth, surface: Surface) -> CentreCurvature | None:
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
    share = difference**2 * n / (n + 1) / float(surface.fit.ssr)
    return CentreCurvature(difference, relative, share, t, float(2 * student.sf(abs(t), (n - 1) / 3)))


def normality(values: FloatArray) -> Normality:
    """Tests of Shapiro and Wilk, and of Lilliefors."""
    return Normality(float(shapiro(values).pvalue), float(lilliefors(values, "norm")[1]))

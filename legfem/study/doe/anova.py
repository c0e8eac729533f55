"""The analysis of variance of a response surface (Eq. 5 to 11)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import f as fisher
from scipy.stats import t as student

from legfem.study.doe.surface import Surface

Counting = Literal["coefficients", "factors"]
"""What p is in n - p and p - 1: the surface's coefficients (16 for five factors), which is right
and what Table 3 used, or the factors (5), as in the paper's text."""

LEVEL = 0.05


@dataclass(frozen=True)
class Anova:
    """One row of the paper's Table 3."""

    ssr: float
    sse: float
    model_dof: int
    error_dof: int
    predicted_r_squared: float
    """1 - PRESS / SST: R2 for runs that the surface hasn't seen."""

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
        """Of an F as large, were there no effects."""
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
        """At 5 %."""
        return self.p_value <= LEVEL

    @property
    def is_interaction(self) -> bool:
        """Whether two factors make it."""
        return ":" in self.term


def anova(surface: Surface, counting: Counting = "coefficients") -> Anova:
    """Return the analysis of variance; the degrees of freedom are those of the runs used."""
    fit = surface.fit
    n = int(fit.nobs)
    p = len(surface.coefficients) if counting == "coefficients" else len(surface.factors)
    leverage = fit.get_influence().hat_matrix_diag
    press = float(np.sum((surface.residuals / (1 - leverage)) ** 2)) if leverage.max() < 1 else np.nan
    return Anova(float(fit.ess), float(fit.ssr), p - 1, n - p, 1 - press / float(fit.centered_tss))


def coefficient_tests(surface: Surface, counting: Counting = "coefficients") -> tuple[CoefficientTest, ...]:
    r"""Return the tests in the formula's order, the intercept first.

    .. math:: t = \beta / \sqrt{MSE\, [(X^T X)^{-1}]_{ii}},

    which is the square root of MSE/32 for effects and of MSE/33 for the intercept of 33 runs.
    """
    table = anova(surface, counting)
    spread = np.sqrt(table.mse * np.diag(surface.fit.normalized_cov_params))
    tests = []
    for term, value, error in zip(surface.coefficients.index, surface.coefficients, spread, strict=True):
        t = value / error if error > 0 else np.inf
        p_value = float(2 * student.sf(abs(t), table.error_dof))
        tests.append(CoefficientTest(str(term), float(value), float(error), float(t), p_value))
    return tuple(tests)

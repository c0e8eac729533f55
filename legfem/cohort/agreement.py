r"""How well repeated tests agree: intraclass correlation, standard error of measurement, limits of agreement.

Legs are tested once at each of k levels, sessions or raters. In a two-way random-effects model with the mean squares of
legs :math:`M_R`, of levels :math:`M_C` and of what is left :math:`M_E`, the correlation of single tests for absolute
agreement is ICC(2,1) of Shrout and Fleiss (1979), ICC(A,1) of McGraw and Wong (1996); its interval is theirs (Table 7).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import f as f_distribution
from scipy.stats import norm
from scipy.stats import t as t_distribution

from legfem.common.units import FloatArray

ICC_FORM = "ICC(A,1), two-way random effects, absolute agreement, single measurement"


@dataclass(frozen=True)
class Agreement:
    """Agreement of single tests; numbers are of the values as given, here logarithms."""

    targets: int
    levels: int
    icc: float
    icc95: tuple[float, float]
    sem: float
    """Standard error of measurement: of levels and of what is left, together."""

    @property
    def detectable(self) -> float:
        """Least difference between two tests that exceeds their errors (95 %): 1.96 sqrt(2) SEM."""
        return 1.96 * math.sqrt(2.0) * self.sem


def agreement(table: FloatArray, people: int | None = None) -> Agreement:
    """Return how well tests agree.

    Parameters
    ----------
    table : (n, k) array
        A row a leg, a column a level; nothing missing, n and k at least 2.
    people : int, optional
        Whose legs they are, where that are fewer. Both legs of a person are alike: intervals then have the degrees of
        freedom of one leg each, which is on the safe side.
    """
    n, k = table.shape
    rows, columns, middle = table.mean(axis=1), table.mean(axis=0), table.mean()
    of_rows = k * np.sum((rows - middle) ** 2) / (n - 1)
    of_rest = np.sum((table - rows[:, None] - columns + middle) ** 2) / ((n - 1) * (k - 1))
    between = np.sum((columns - middle) ** 2) / (k - 1) - of_rest / n
    icc = (of_rows - of_rest) / (of_rows + (k - 1) * of_rest + k * between)
    m = people or n
    of_columns = of_rest + m * between
    a, b = k * icc / (m * (1 - icc)), 1 + k * icc * (m - 1) / (m * (1 - icc))
    freedom = (a * of_columns + b * of_rest) ** 2 / (
        (a * of_columns) ** 2 / (k - 1) + (b * of_rest) ** 2 / ((m - 1) * (k - 1))
    )
    above, below = f_distribution.ppf(0.975, m - 1, freedom), f_distribution.ppf(0.975, freedom, m - 1)
    shared = k * of_columns + (k * m - k - m) * of_rest
    low = m * (of_rows - above * of_rest) / (above * shared + m * of_rows)
    high = m * (below * of_rows - of_rest) / (shared + m * below * of_rows)
    return Agreement(n, k, float(icc), (float(low), float(high)), float(np.sqrt(max(between, 0.0) + of_rest)))


@dataclass(frozen=True)
class Limits:
    """Bland and Altman's limits of agreement of two tests, with 95 % intervals of each."""

    bias: float
    bias95: tuple[float, float]
    low: float
    low95: tuple[float, float]
    high: float
    high95: tuple[float, float]


def limits(differences: FloatArray, people: int | None = None) -> Limits:
    """Return the limits between which 95 % of differences lie (Bland and Altman 1999, with their errors).

    Of several legs a person, intervals count people.
    """
    n = people or len(differences)
    mean, sd = float(np.mean(differences)), float(np.std(differences, ddof=1))
    z, t = norm.ppf(0.975), t_distribution.ppf(0.975, n - 1)
    of_mean = t * sd / math.sqrt(n)
    of_limit = t * sd * math.sqrt(1 / n + z**2 / (2 * (n - 1)))

    def within(value: float, half: float) -> tuple[float, float]:
        return float(value - half), float(value + half)

    low, high = mean - z * sd, mean + z * sd
    return Limits(mean, within(mean, of_mean), low, within(low, of_limit), high, within(high, of_limit))

r"""How well repeated tests agree: intraclass correlation, errors of measurement, limits; a mixed model.

Legs are tested once at each of k levels, sessions or raters. In a two-way random-effects model with the mean squares of
legs :math:`M_R`, of levels :math:`M_C` and of what is left :math:`M_E`, the correlation of single tests for absolute
agreement is ICC(2,1) of Shrout and Fleiss (1979), ICC(A,1) of McGraw and Wong (1996); its interval is theirs (Table 7).

The mixed model knows each value's own error, and is fitted by restricted maximum likelihood:

.. math::
    y_i = x_i^T \beta + u_{person} + v_{leg} + a_i z_{leg} + e_i + \epsilon_i, \qquad
    z \sim N(0, 1), \quad \epsilon_i \sim N(0, s_i^2),

with the variances of people, of legs within them and of tests within legs unknown and every :math:`s_i` known, as in a
meta-analysis of several levels; so is what a leg's tests err by alike, :math:`a_i`, which no repeat averages out.
(statsmodels' MixedLM takes no known errors; without them both agree.) Covariances are inverted level by level by the
Sherman-Morrison formula, so that thousands of people take a fraction of a second.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import minimize
from statsmodels.tools.numdiff import approx_hess3

from legfem.common.units import FloatArray

type Numbers = NDArray[np.int_]


@dataclass(frozen=True, eq=False)
class Fitted:
    """Effects and variances."""

    effects: FloatArray
    covariance: FloatArray
    """Covariance of the effects."""
    sd: tuple[float, float, float]
    """Of people, of legs within them, of tests within legs beyond their own errors."""
    sd95: tuple[tuple[float, float], ...]
    """Their intervals, from the curvature in the logarithms; to infinity where one is zero."""
    freedom: int
    """People beyond the number of effects: the degrees of freedom on the safe side."""

    def effect(self, number: int) -> tuple[float, float, float, float]:
        """Return an effect, the ends of its 95 % interval and its p-value."""
        value, sd = float(self.effects[number]), float(np.sqrt(self.covariance[number, number]))
        half = float(stats.t.ppf(0.975, self.freedom)) * sd
        return value, value - half, value + half, float(2 * stats.t.sf(abs(value) / sd, self.freedom))


@dataclass(frozen=True, eq=False)
class MixedModel:
    """What is fitted.

    Parameters
    ----------
    y : (n,) array
        Values.
    x : (n, p) array
        Design, of full rank.
    own : (n,) array
        Standard error of each value, by what no other test of the leg has.
    alike : (n,) array
        Standard error of each by what the leg's tests have together.
    person, leg : (n,) arrays
        Numbers from 0; legs are numbered through all people.
    """

    y: FloatArray
    x: FloatArray
    own: FloatArray
    alike: FloatArray
    person: Numbers
    leg: Numbers

    def fit(self) -> Fitted:
        """Return the fit."""
        owner = np.zeros(self.leg.max() + 1, dtype=int)
        owner[self.leg] = self.person
        free = [
            len(owner) > self.person.max() + 1 or len(self.y) > len(owner),  # else people can't be told from tests
            len(self.y) > len(owner) > self.person.max() + 1,
            True,
        ]
        beta = np.linalg.lstsq(self.x, self.y, rcond=None)[0]
        scale = float(np.std(self.y - self.x @ beta)) or 1.0

        def whole(sd: FloatArray) -> FloatArray:
            every = np.zeros(3)
            every[free] = sd
            return every

        def cost(sd: FloatArray) -> float:
            return self._solved(whole(sd), owner)[0]

        starts = np.full(sum(free), 0.5 * scale)
        found = minimize(cost, starts, method="L-BFGS-B", bounds=[(1e-6 * scale, 10 * scale)] * sum(free))
        sd = whole(found.x)
        _, effects, covariance = self._solved(sd, owner)
        people = int(self.person.max()) + 1
        ends = iter(_intervals(cost, found.x, scale))
        sd95 = tuple(next(ends) if one else (0.0, 0.0) for one in free)
        at = tuple(float(v) if v > 1e-5 * scale else 0.0 for v in sd)
        return Fitted(effects, covariance, (at[0], at[1], at[2]), sd95, max(people - self.x.shape[1], 1))

    def _solved(self, sd: FloatArray, owner: Numbers) -> tuple[float, FloatArray, FloatArray]:
        """Return minus twice the restricted log-likelihood (but for a constant), effects and their covariance."""
        variance = sd[2] ** 2 + self.own**2 + 1e-12
        both = np.column_stack([self.x, self.y])
        weighted = both / variance[:, None]
        inner = both.T @ weighted
        log_det = float(np.sum(np.log(variance)))
        slips = self.alike / variance
        grown = 1 + sums_by(self.leg, self.alike * slips)
        slipped = sums_by(self.leg, self.alike[:, None] * weighted)
        inner -= (slipped / grown[:, None]).T @ slipped
        log_det += float(np.sum(np.log(grown)))
        # What the other levels see of a leg: its sums less those along what its tests err by alike.
        along = sums_by(self.leg, slips) / grown
        precision = sums_by(self.leg, 1 / variance) - along * sums_by(self.leg, slips)
        sums = sums_by(self.leg, weighted) - along[:, None] * slipped
        for level, of in ((1, np.arange(len(owner))), (0, owner)):
            total, summed = sums_by(of, precision), sums_by(of, sums)
            grown = 1 + sd[level] ** 2 * total
            inner -= (summed * (sd[level] ** 2 / grown)[:, None]).T @ summed
            log_det += float(np.sum(np.log(grown)))
            precision, sums = total / grown, summed / grown[:, None]
        information, right = inner[:-1, :-1], inner[:-1, -1]
        covariance = np.linalg.inv(information)
        effects = covariance @ right
        left = float(inner[-1, -1] - right @ effects)
        return log_det + left + float(np.linalg.slogdet(information)[1]), effects, covariance


def sums_by(of: Numbers, values: FloatArray) -> FloatArray:
    """Return the sums (g, ...) of values (n, ...) by numbers (n,) from 0."""
    size = int(of.max()) + 1
    if values.ndim == 1:
        return np.bincount(of, values, size).astype(np.float64)
    return np.column_stack([np.bincount(of, column, size) for column in values.T])


def _intervals(cost: Callable[[FloatArray], float], at: FloatArray, scale: float) -> list[tuple[float, float]]:
    """Ends of 95 % intervals of standard deviations, from the curvature of the cost in their logarithms."""
    inside = np.flatnonzero(at > 1e-4 * scale)

    def of_inside(logarithms: FloatArray) -> float:
        sd = at.copy()
        sd[inside] = np.exp(logarithms)
        return cost(sd)

    spread = np.full(len(at), np.inf)
    if len(inside):
        covariance = 2 * np.linalg.pinv(approx_hess3(np.log(at[inside]), of_inside, epsilon=0.05))
        spread[inside] = np.sqrt(np.clip(np.diag(covariance), 0.0, 1e5))  # no further than numbers go
    return [
        (float(v * np.exp(-1.96 * s)), float(v * np.exp(1.96 * s))) if np.isfinite(s) else (0.0, float("inf"))
        for v, s in zip(at, spread, strict=True)
    ]


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
    # Theirs times m (1 - ICC), which is zero where all agree wholly.
    a, b = k * icc * of_columns, (m * (1 - icc) + k * icc * (m - 1)) * of_rest
    freedom = (a + b) ** 2 / (a**2 / (k - 1) + b**2 / ((m - 1) * (k - 1))) if a or b else 1.0
    above, below = stats.f.ppf(0.975, m - 1, freedom), stats.f.ppf(0.975, freedom, m - 1)
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
    z, t = stats.norm.ppf(0.975), stats.t.ppf(0.975, n - 1)
    of_mean = t * sd / math.sqrt(n)
    of_limit = t * sd * math.sqrt(1 / n + z**2 / (2 * (n - 1)))

    def within(value: float, half: float) -> tuple[float, float]:
        return float(value - half), float(value + half)

    low, high = mean - z * sd, mean + z * sd
    return Limits(mean, within(mean, of_mean), low, within(low, of_limit), high, within(high, of_limit))

r"""Confidence intervals by profile, the verdicts that they lead to, and what a law that misses may do to a stiffness.

A profile interval is where the least sum of squares, all other parameters refitted within their
bounds, rises by :math:`t^2 V_{kk} / (A^{-1})_{kk}`: the height at which a quadratic sum has Wald's
half-width :math:`t \sqrt{V_{kk}}` (`legfem.inverse.least_squares`). So it may be lopsided, and
never leaves the bounds. How many standard errors t stands for depends on how well the errors'
sizes are known, see `quantile`.

A law that doesn't describe recordings fits their parts with different constants, and what its constant means hangs on
the part that was looked at. Of forces m and predictions f in a part, with errors of covariance C,

.. math:: k = f^T m / f^T f, \qquad s^2 = f^T C f / (f^T f)^2

is the factor on all stiffness that the part asks for, with its standard error. Parts are a few readings of one number:
the greatest :math:`|\ln k|` beyond errors is taken as one standard deviation of what the misfit may do to a stiffness.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq
from scipy.special import stdtrit

from legfem.common.numbers import is_determined
from legfem.common.units import FloatArray
from legfem.inverse.least_squares import Residual, least_residual
from legfem.inverse.parameter import Parameter

NUMERICAL_ERROR = 0.0025
"""Standard deviation of the forward model's error relative to its force. The convergence study
bounds it by 0.5 % (`python -m studies.frauziols convergence`), and another code's curves lie within
0.35 % (`tests/verification/test_other_code.py`)."""
NUMERICAL_LENGTH_MM = 10.0
"""Displacement over which that error is correlated: so slowly do those differences change."""
PRIOR_DOF = 10
"""Degrees of freedom that a data sheet's figures are worth: a standard deviation known to some
20 % (JCGM 100:2008, G.4.2)."""
IDENTIFIABLE_WITHIN = 0.1
"""Half-width of the 95 % interval over the value up to which a parameter is called identifiable:
a third of how persons of one group differ (30 to 50 % in Frauziols et al., Table 5)."""
WEAKLY_WITHIN = 0.5
"""The same for weakly identifiable: the interval then still tells soft from stiff."""

Identifiability = Literal["identifiable", "weakly identifiable", "not identifiable"]
VERDICTS: tuple[Identifiability, ...] = ("identifiable", "weakly identifiable", "not identifiable")
"""From best to worst."""


def quantile(repeat_dof: int) -> float:
    """Return Student's two-sided 95 % quantile for a covariance known from so many repeats."""
    return float(stdtrit(PRIOR_DOF + repeat_dof, 0.975))


def identifiability(half_width: float) -> Identifiability:
    """Return the word for a 95 % interval's half-width over the value."""
    if half_width <= IDENTIFIABLE_WITHIN:
        return "identifiable"
    return "weakly identifiable" if half_width <= WEAKLY_WITHIN else "not identifiable"


Bound = Literal["", "lower", "upper"]
"""At which bound of the search a value stands."""

_WITHIN_PRIOR = (-1.96, 1.96)
ADDS_NOTHING = 0.9
"""Standard error over that of the prior, above which the data add nothing to the prior."""


_AT_THE_END = 1e-6


@dataclass(frozen=True)
class Estimated:
    """How well one parameter is known; numbers in the parameter's unit.

    Parameters
    ----------
    parameter : Parameter
        With its bounds and, if there is one, its prior.
    value : float
        Found.
    standard_error : float
        Of the value, with the prior.
    ci95 : tuple of float
        95 % interval.
    """

    parameter: Parameter
    value: float
    standard_error: float
    ci95: tuple[float, float]

    @property
    def at_bound(self) -> Bound:
        """Whether the value stands at a bound of the search."""
        return bound_of(self.value, self.parameter.bounds)

    @property
    def undetermined(self) -> bool:
        """Whether the interval spans a factor of ten, or is all that was searched and says nothing of the value."""
        low, high = self.parameter.bounds
        searched = self.ci95[0] <= low * (1 + _AT_THE_END) and self.ci95[1] >= high * (1 - _AT_THE_END)
        return bool(searched) or not is_determined(self.value, self.ci95)

    @property
    def one_number(self) -> bool:
        """Whether a value is known, rather than a bound of it or nothing."""
        return not (self.undetermined or self.at_bound)

    @property
    def relative_half_width(self) -> float:
        """Half the interval over the value, infinite at 0.

        Of a linear parameter, whose 0 is a value like others: over half of the range before,
        the prior's 95 % interval or the bounds.
        """
        half = 0.5 * (self.ci95[1] - self.ci95[0])
        parameter = self.parameter
        if parameter.scale == "linear":
            prior = parameter.prior
            low, high = parameter.bounds if prior is None else map(prior.value_at, _WITHIN_PRIOR)
            return half / (0.5 * (high - low))
        return half / self.value if self.value > 0 else math.inf

    @property
    def error_over_prior(self) -> float:
        """Standard error over the prior's; 0 without a prior."""
        prior = self.parameter.prior
        if prior is None:
            return 0.0
        return self.standard_error / prior.width(self.value)

    def verdict(self, model_fits: bool) -> Identifiability:
        """Return the word for it; weakly identifiable at best where the model misses the data.

        One at a bound of the search isn't identifiable, nor one that is undetermined or of which the data say nothing
        beyond its prior.
        """
        word = identifiability(self.relative_half_width)
        if self.error_over_prior > ADDS_NOTHING or not self.one_number:
            return "not identifiable"
        return "weakly identifiable" if word == "identifiable" and not model_fits else word


def bound_of(value: float, bounds: tuple[float, float]) -> Bound:
    """Return at which bound a value stands, or beyond which."""
    if value <= bounds[0]:
        return "lower"
    return "upper" if value >= bounds[1] else ""


def with_further(value: float, ends: tuple[float, float], more: ArrayLike, bounds: ArrayLike) -> tuple[float, float]:
    """Return an interval's ends with further errors' half-widths, squares added to squares (2,), within bounds."""
    ways = np.hypot(np.subtract(ends, value), more)
    low, high = np.clip(value + ways * (-1, 1), *np.asarray(bounds))
    return float(low), float(high)


# Of a value's size, for differences.
_MOVE = 1e-5


def effective_degrees(variance: float, parts: Iterable[tuple[float, float]]) -> float:
    r"""Return the degrees of freedom of a variance, some of whose parts are known poorly.

    Welch and Satterthwaite's :math:`V^2 / \sum_i V_i^2 / \nu_i` (JCGM 100:2008, G.4.1), where a
    standard deviation known to a share r has :math:`\nu = 1 / (2 r^2)` (G.4.2).

    Parameters
    ----------
    variance : float
        The whole.
    parts : pairs of float
        Parts and their degrees of freedom; parts known exactly needn't be there.
    """
    total = sum(part**2 / degrees for part, degrees in parts)
    return np.inf if total == 0 else variance**2 / total


@dataclass(frozen=True, eq=False)
class SquaresProfile:
    """The least sum of squares with one parameter held, the others refitted.

    Parameters
    ----------
    residual : callable
        Weighted differences and departures (..., n) of values (..., p).
    at : (p,) array
        Where their sum of squares is least.
    k : int
        Which parameter is held.
    bounds : (p, 2) array
        Of the values.
    half_width : float
        First guess of its interval's.
    """

    residual: Residual
    at: FloatArray
    k: int
    bounds: FloatArray
    half_width: float

    def interval(self, rise: float) -> tuple[float, float]:
        """Return where the profile stays within ``rise`` of its least."""
        at, bounds, least = self.at[self.k], self.bounds[self.k], float(np.sum(self.residual(self.at) ** 2))

        def above(value: float) -> float:
            return float(np.sum(self.residual(self.refitted(value)) ** 2)) - least - rise

        def end(side: int) -> float:
            inner, width = float(at), self.half_width
            bound = float(bounds[0] if side < 0 else bounds[1])
            while inner != bound:
                outer = float(np.clip(at + side * width, *bounds))
                if above(outer) > 0:
                    return float(brentq(above, inner, outer, xtol=1e-6 * self.half_width))
                inner, width = outer, 1.5 * width
            return bound

        return end(-1), end(1)

    @property
    def others(self) -> list[int]:
        """Numbers of the parameters that are refitted."""
        return [j for j in range(len(self.at)) if j != self.k]

    @property
    def units(self) -> FloatArray:
        """Numbers (p,) of the values' sizes, so that a search steps alike in all."""
        width = self.bounds[:, 1] - self.bounds[:, 0]
        return np.asarray(np.clip(np.abs(self.at), 1e-3 * width, width))

    def refitted(self, value: float) -> FloatArray:
        """Return all values (p,) where the k-th is held and the others are refitted."""
        if not self.others:
            return np.array([value])
        others, units = self.others, self.units[self.others]
        box = self.bounds[others] / units[:, None]
        near = self.at[others] + self.slope * (value - self.at[self.k])
        start = np.clip(near / units, *box.T)

        def whole(free: FloatArray) -> FloatArray:
            values = np.empty((*free.shape[:-1], len(self.at)))
            values[..., self.k], values[..., others] = value, free * units
            return np.asarray(np.clip(values, *self.bounds.T))

        def left(free: FloatArray) -> FloatArray:
            return self.residual(whole(free))

        def slopes(free: FloatArray) -> FloatArray:
            return _differences(left, free, np.full(len(free), _MOVE), box)

        return whole(least_residual(left, start, box, jacobian=slopes))

    @cached_property
    def slope(self) -> FloatArray:
        """How the others follow the held one where the residual is linear; (p - 1,)."""
        own = np.arange(len(self.at)) == self.k
        moves = 1e-3 * np.where(own, self.half_width, self.units)
        jacobian, units = _differences(self.residual, self.at, moves, self.bounds), self.units[self.others]
        return np.asarray(units * np.linalg.lstsq(jacobian[:, self.others] * units, -jacobian[:, self.k])[0])


def _differences(residual: Residual, at: FloatArray, moves: FloatArray, bounds: FloatArray) -> FloatArray:
    """Return a residual's derivatives (n, p) at values (p,) by central differences over moves (p,) within bounds."""
    up, down = np.clip([at + np.diag(moves), at - np.diag(moves)], *bounds.T)
    ends = residual(np.concatenate([up, down]))
    return np.asarray((ends[: len(at)] - ends[len(at) :]).T / np.diag(up - down))


THIRDS = "first", "second", "last"
_FEWEST = 3
"""Readings of a part."""
_DEVIATIONS = 1.96
"""Standard deviations of a 95 % interval, either way."""
_LARGEST = 50.0
"""Logarithm of a factor that is beyond all bounds."""


@dataclass(frozen=True)
class PartDeparture:
    """The part of the recordings that departs most from a law."""

    part: str
    """In words."""
    factor: float
    """On all stiffness, that it asks for."""
    by: float
    """Logarithm of that without what errors make, 0 at least; infinite where no stiffness describes it."""

    def carried(self, value: float, interval: tuple[float, float], bounds: tuple[float, float]) -> tuple[float, float]:
        """Return a stiffness' 95 % interval, no narrower than that leaves it, within its bounds."""
        if not self.by or value <= 0.0:
            return interval
        factor = math.exp(min(_DEVIATIONS * self.by, _LARGEST))
        return max(bounds[0], min(interval[0], value / factor)), min(bounds[1], max(interval[1], value * factor))

    @property
    def text(self) -> str:
        """What is said of it."""
        if self.factor <= 0.0:
            return f"no stiffness describes {self.part}"
        return f"{self.part} by itself gives {self.factor:.2g} times this stiffness"


NO_DEPARTURE = PartDeparture("", 1.0, 0.0)


def third_of(displacement: FloatArray, depth: float) -> NDArray[np.int_]:
    """Return the third of a depth that displacements (n,) lie in."""
    return np.clip((len(THIRDS) * displacement / depth).astype(int), 0, len(THIRDS) - 1)


def by_third(displacement: FloatArray, depth: float, after: NDArray[np.bool_]) -> Mapping[str, NDArray[np.int_]]:
    """Return places of readings (n,) by the third of a loading's depth that they lie in; of those after it none."""
    third = third_of(displacement, depth)
    return {f"the {name} third of the depth": np.flatnonzero((third == k) & ~after) for k, name in enumerate(THIRDS)}


def departure_of(
    parts: Mapping[str, NDArray[np.int_]], measured: FloatArray, predicted: FloatArray, covariance: FloatArray
) -> PartDeparture:
    """Return the part that departs most from predictions.

    Parameters
    ----------
    parts
        Places of readings by a part's name.
    measured, predicted
        (n,).
    covariance
        (n, n): of their differences, but for what the law misses.
    """
    found = NO_DEPARTURE
    for name, places in parts.items():
        force, model = measured[places], predicted[places]
        squares = float(model @ model)
        if not squares or len(places) < _FEWEST:
            continue
        factor = float(model @ force) / squares
        error = math.sqrt(float(model @ covariance[np.ix_(places, places)] @ model)) / squares
        if factor <= 0.0:
            return PartDeparture(name, factor, math.inf)
        by = math.sqrt(max(math.log(factor) ** 2 - (error / factor) ** 2, 0.0))
        if by > found.by:
            found = PartDeparture(name, factor, by)
    return found

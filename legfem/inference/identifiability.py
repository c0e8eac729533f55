"""Whether a parameter can be told from the data."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from legfem.inference.constants import Identifiability, identifiability
from legfem.inference.parameter import Parameter

Bound = Literal["", "lower", "upper"]
"""At which bound of the search a value stands."""

_WITHIN_PRIOR = (-1.96, 1.96)
ADDS_NOTHING = 0.9
"""Standard error over that of the prior, above which the data add nothing to the prior."""


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
    def relative_half_width(self) -> float:
        """Half the interval over the value, infinite at 0.

        Of a linear parameter, whose 0 is a value like others: over half of what was open before,
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
        return self.standard_error / (prior.sd * (self.value if prior.scale == "log" else 1.0))

    def verdict(self, model_fits: bool) -> Identifiability:
        """Return the word for it; weakly identifiable at best where the model misses the data.

        One at a bound of the search isn't identifiable, nor one of which the data say nothing
        beyond its prior.
        """
        if self.error_over_prior > ADDS_NOTHING:
            return "not identifiable"
        return verdict_on(self.relative_half_width, self.at_bound, model_fits)


def verdict_on(relative_half_width: float, at_bound: Bound, model_fits: bool) -> Identifiability:
    """Return the word for a 95 % interval: of a bound, none; of a model that misses, a weak one."""
    word = identifiability(relative_half_width)
    if at_bound:
        return "not identifiable"
    return "weakly identifiable" if word == "identifiable" and not model_fits else word


def bound_of(value: float, bounds: tuple[float, float], within: float = 0.0) -> Bound:
    """Return at which bound a value stands, to within a relative distance."""
    if value <= bounds[0] * (1 + within):
        return "lower"
    return "upper" if value >= bounds[1] * (1 - within) else ""

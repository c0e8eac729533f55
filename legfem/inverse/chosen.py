"""Which of several laws the data ask for."""

from collections.abc import Sequence
from typing import Any

from scipy.special import chdtrc

from legfem.inverse.fit import Fit

SIGNIFICANT = 0.01
"""Chance below which it doesn't explain what a further parameter gains."""


def preferred(results: Sequence[Fit[Any]]) -> Fit[Any]:
    """Return the law that the data ask for: the better fit, unless chance explains that it is."""
    better, *others = sorted(results, key=misfit_of)
    if not others:
        return better
    fewer = len(better.estimates) > len(others[0].estimates)
    by_chance = fewer and gain_of(better, others[0])[1] >= SIGNIFICANT
    return others[0] if by_chance or better.neo_hookean_limit else better


def gain_of(better: Fit[Any], worse: Fit[Any]) -> tuple[float, float]:
    """Return by how much chi-square falls with further parameters, and the chance of that."""
    gain = worse.goodness.chi_square - better.goodness.chi_square
    extra = len(better.estimates) - len(worse.estimates)
    return gain, float(chdtrc(extra, gain)) if gain > 0 else 1.0


def misfit_of(result: Fit[Any]) -> float:
    """What laws are compared by: the cost that was minimised, without priors."""
    return result.cost.value if result.weighting == "paper" else result.goodness.chi_square


def least_akaike[Details](fits: Sequence[Fit[Details]]) -> Fit[Details]:
    """Law that fits best for the number of its parameters (Akaike's criterion)."""
    return min(fits, key=lambda one: one.goodness.chi_square + 2 * len(one.estimates))

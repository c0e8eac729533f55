"""Warnings that any fit may need."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from legfem.inverse.catalogue import DEEP_C20, key_of
from legfem.inverse.estimates import Estimate
from legfem.inverse.fit import Fit

UNCONVERGED = (
    "The search ended before it converged: the optimum may lie elsewhere. Rerun with another --seed or narrower bounds."
)
LAW_MISSES = "The intervals hold for the law as fitted and understate what is unknown."
_FAR = 3.0
"""Standard deviations from a prior's centre that chance doesn't explain."""


def of_compromise(compromise: str) -> Iterator[str]:
    """Say what the best solve's model gave up to go on, if anything."""
    if compromise:
        yield (
            f"The model of the best fit went on only with {compromise}: its force may be off by "
            "some percent, over very soft fat by more. Use less of the recordings' depth, and see "
            "whether C10 stays."
        )


def at_limits(fit: Fit[Any]) -> Iterator[str]:
    """Say which parameters stand at a bound of the search."""
    for name, one in fit.estimates.items():
        if one.at_bound and not (name == DEEP_C20 and fit.neo_hookean_limit):
            yield f"{key_of(name)} stands at the {one.at_bound} bound of the search."
    if fit.law == "reduced-polynomial" and fit.neo_hookean_limit:
        yield (
            "The reduced polynomial's optimum is its neo-Hookean limit (C20 = 0): these recordings "
            "show no stiffening of the deep tissue beyond it."
        )


def far_from_priors(estimates: Mapping[str, Estimate]) -> Iterator[str]:
    """Say which parameters the recordings put far from what was known beforehand."""
    for name, one in estimates.items():
        prior = one.parameter.prior
        if prior is not None and abs(prior.departure(one.value)) > _FAR:
            yield (
                f"The recordings put {key_of(name)} {abs(prior.departure(one.value)):.1f} standard "
                "deviations from the centre of its prior: one of the two is wrong, or the model is."
            )

"""Warnings that any fit may need."""

from collections.abc import Iterator, Mapping
from typing import Any

from legfem.common.units import mpa_to_kpa
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, symbol_of
from legfem.inverse.estimates import Estimate
from legfem.inverse.fit import Fit
from legfem.inverse.instrument import READINGS
from legfem.inverse.trial import SearchLog

UNCONVERGED = (
    "The search ended before it converged: the optimum may lie elsewhere. Rerun with another --seed or narrower bounds."
)
LAW_MISSES = (
    "Each interval is widened to contain the values that each third of the depth gives by itself; the values "
    "still depend on the depth used."
)
_FAR = 3.0
"""Standard deviations from a prior's centre that chance doesn't explain."""


def of_search(log: SearchLog) -> Iterator[str]:
    """Say that a search ended too early, if it did."""
    if not log.converged:
        yield UNCONVERGED


def of_failed_solves(log: SearchLog, reach: str = "") -> Iterator[str]:
    """Say how many full solves stopped short of a reach in words, where, and why."""
    if log.failed_solves:
        failed = [one for one in log.solves if not one.complete]
        at = ", ".join(f"{mpa_to_kpa(one.values[DEEP_C10]):.3g}" for one in failed if DEEP_C10 in one.values)
        where = [f"C10 {at} kPa"] if at else []
        why = [failed[0].reason] if failed and failed[0].reason else []
        yield (
            f"{log.failed_solves} of {log.forward_solves} full solves stopped short{f' of {reach}' if reach else ''}; "
            f"the search kept away from them{f' ({"; ".join(where + why)})' if where or why else ''}."
        )


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
        # What acts in closed form may have its null at a bound, and no effect is no limit.
        bound = one.parameter.bounds[0 if one.at_bound == "lower" else 1]
        none = name in READINGS and bound == READINGS[name].null
        if one.at_bound and not none and not (name == DEEP_C20 and fit.neo_hookean_limit):
            yield f"{symbol_of(name)} stands at the {one.at_bound} bound of the search."
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
                f"The recordings put {symbol_of(name)} {abs(prior.departure(one.value)):.1f} standard "
                "deviations from the centre of its prior: one of the two is wrong, or the model is."
            )

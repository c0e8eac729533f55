"""Whether a parameter can be told from the data, and why."""

from __future__ import annotations

import math
from dataclasses import dataclass

from legfem.identify.result import Bound, Identifiability
from legfem.identify.settings import IdentificationSettings

# Correlation of the parameters' errors above which their trade is worth a word.
_TRADE = 0.9


@dataclass(frozen=True)
class Evidence:
    """What is known of one parameter."""

    name: str
    """``C10`` or ``C20``."""
    value: float
    """kPa."""
    ci95: tuple[float, float]
    """kPa."""
    at_bound: Bound
    correlation: float
    """Of the two parameters' errors; NaN for one parameter."""
    per_fat: float
    """Relative change if the assumed C10 of the fat were 10 % higher; NaN if none."""
    per_fascia: float
    """The same for the fascia."""
    law_fits: bool
    """Whether the law describes the recordings within their errors."""


def judge(found: Evidence, settings: IdentificationSettings) -> tuple[Identifiability, str]:
    """Return the verdict on a parameter, and why.

    Its interval decides: narrow enough over the value (`IdentificationSettings`) is identifiable.
    A parameter at its upper bound isn't; one of a law that misses the recordings is weakly so at
    best, since it changes with the depth that is used.
    """
    low, high = found.ci95
    half = 0.5 * (high - low) / found.value if found.value > 0 else math.inf
    verdict: Identifiability = "not identifiable"
    if found.at_bound != "upper" and half <= settings.weakly_within:
        narrow = half <= settings.identifiable_within
        verdict = "identifiable" if narrow and found.law_fits else "weakly identifiable"
    if found.at_bound == "lower":
        reasons = [f"the optimum stands at the lower bound; at most {high:.3g} kPa fits (95 %)"]
    elif found.at_bound == "upper":
        reasons = ["the optimum stands at the upper bound: widen the bounds or doubt the data"]
    else:
        reasons = [f"95 % interval {low:.3g} to {high:.3g} kPa, {_percent(half)} either side"]
    if not found.law_fits:
        reasons.append("the law misses the recordings, so the value depends on the depth used")
    if abs(found.correlation) > _TRADE:
        reasons.append(f"C10 and C20 trade off (correlation {found.correlation:.2f})")
    moves = [
        f"{_signed(change)} if the assumed C10 of the {tissue} were 10 % higher"
        for tissue, change in (("fat", found.per_fat), ("fascia", found.per_fascia))
        if math.isfinite(change)
    ]
    if moves:
        reasons.append(f"{found.name} changes by " + " and by ".join(moves))
    if found.name == "C10":
        reasons.append("a constant 3D factor can't be told from it")
    return verdict, "; ".join(reasons)


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share < 1 else "over 100 %"


def _signed(share: float) -> str:
    return f"{100 * share:+.1f} %"

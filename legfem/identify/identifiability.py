"""Whether a parameter can be told from the data, and why."""

from __future__ import annotations

import math

from legfem.identify.result import Identifiability
from legfem.identify.settings import IdentificationSettings

# Correlation of the parameters' errors above which their trade is worth a word.
_TRADE = 0.9


def judge(
    name: str,
    value: float,
    ci95: tuple[float, float],
    correlation: float,
    per_fat: float,
    per_fascia: float,
    at_bound: str,
    settings: IdentificationSettings,
) -> tuple[Identifiability, str]:
    """Return the verdict on a parameter from its interval, with its reasons.

    Parameters
    ----------
    name
        ``C10`` or ``C20``.
    value, ci95
        kPa.
    correlation
        Of the two parameters' errors; NaN for one parameter.
    per_fat, per_fascia
        Relative change of the value if the assumed C10 of fat or fascia were 10 % higher.
    at_bound
        ``lower``, ``upper`` or nothing.
    settings
        With the limits of the verdicts.
    """
    low, high = ci95
    half = 0.5 * (high - low) / value if value > 0 else math.inf
    verdict: Identifiability = "not identifiable"
    if at_bound != "upper" and half <= settings.identifiable_within:
        verdict = "identifiable"
    elif at_bound != "upper" and half <= settings.weakly_within:
        verdict = "weakly identifiable"
    if at_bound == "lower":
        reasons = [f"the optimum stands at the lower bound; at most {high:.3g} kPa fits (95 %)"]
    elif at_bound == "upper":
        reasons = ["the optimum stands at the upper bound: widen the bounds or doubt the data"]
    else:
        reasons = [f"95 % interval {low:.3g} to {high:.3g} kPa, {_percent(half)} either side"]
    if abs(correlation) > _TRADE:
        reasons.append(f"C10 and C20 trade off (correlation {correlation:.2f})")
    moves = [
        f"{_signed(change)} if the assumed C10 of the {tissue} were 10 % higher"
        for tissue, change in (("fat", per_fat), ("fascia", per_fascia))
        if math.isfinite(change)
    ]
    if moves:
        reasons.append(f"{name} changes by " + " and by ".join(moves))
    if name == "C10":
        reasons.append("a constant 3D factor can't be told from it")
    return verdict, "; ".join(reasons)


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share < 1 else "over 100 %"


def _signed(share: float) -> str:
    return f"{100 * share:+.1f} %"

"""What isn't known of a test, such as whether its ends stick: all are fitted, and weighed by the recordings.

All are as probable beforehand. Intervals are those of the mixture, each alternative counting by its evidence beside a
smooth error of unknown form (`legfem.specimens.misfit`), alike in all recordings, and summed over the laws that are
fitted: a law that bends a curve as ends do leaves them open. Where even the best law misses, its evidence counts the
less by Birge's ratio squared: a form that is wrong tells little of another. Lateral stretches, where a video shows the
specimen's side, weigh the alternatives beside the forces (`legfem.specimens.lateral_stretch`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from scipy.optimize import brentq
from scipy.special import logsumexp, softmax
from scipy.stats import norm

from legfem.inverse.catalogue import DEEP_C10, symbol_of
from legfem.inverse.comparison import ErrorSource
from legfem.inverse.estimates import Estimate
from legfem.inverse.fit import Fit
from legfem.inverse.intervals import identifiability, verdict_on
from legfem.specimens.details import SpecimenDetails, Weighed

type _Fit = Fit[SpecimenDetails]


def probabilities(each: Mapping[str, Sequence[_Fit]]) -> dict[str, float]:
    """Return how probable alternatives are, by the fits of some laws to each."""
    every = [fit for fits in each.values() for fit in fits]
    # Contacts differ between alternatives, and so the number of readings by some; one law is no better beside another.
    readings = min(fit.details.misfit.readings for fit in every)
    least = max(min(fit.details.misfit.rms for fit in every), 1e-6)
    dispersion = max(1.0, min(fit.goodness.chi_square / max(fit.goodness.degrees_of_freedom, 1) for fit in every))
    evidence = [
        logsumexp([readings * fit.details.misfit.log_evidence(least) for fit in fits]) / dispersion + _of_side(fits)
        for fits in each.values()
    ]
    return dict(zip(each, map(float, softmax(evidence)), strict=True))


def _of_side(fits: Sequence[_Fit]) -> float:
    """Return the logarithm of the lateral stretches' density beside the law that meets them best; 0 without any."""
    return max((fit.details.lateral.log_density for fit in fits if fit.details.lateral), default=0.0)


def weighed(fits: Mapping[str, _Fit], chances: Mapping[str, float], words: Mapping[str, str], to_know: str) -> _Fit:
    """Return the fit of the most probable alternative, its intervals over all.

    Parameters
    ----------
    fits
        By alternative, of one law.
    chances
        Probabilities of the alternatives.
    words
        What each is.
    to_know
        How it could be known, as a sentence without its end.
    """
    every = sorted(
        (Weighed(name, words[name], chances[name], fit.estimates) for name, fit in fits.items()),
        key=lambda one: -one.probability,
    )
    best = fits[every[0].name]
    estimates = {name: _over_all(name, one, every, best.goodness.fits) for name, one in best.estimates.items()}
    details = replace(best.details, alternatives=tuple(every))
    found = replace(best, estimates=MappingProxyType(estimates), details=details)
    return replace(found, warnings=(alternatives_text(every, to_know), *found.warnings))


def _over_all(name: str, best: Estimate, every: Sequence[Weighed], fits: bool) -> Estimate:
    """Return an estimate with the mixture's interval."""
    known = [(one.probability, one.estimates[name]) for one in every if name in one.estimates]
    low, high = (_mixed(known, level) for level in (0.025, 0.975))
    if len(known) < len(every) or not low < high:
        return best
    widened = replace(best, ci95=(min(low, best.value), max(high, best.value)))
    half = widened.relative_half_width
    word = verdict_on(half, best.at_bound, fits)
    if identifiability(half) == identifiability(best.relative_half_width):
        word = best.identifiability
    variance = sum(p * (e.standard_error**2 + (e.value - best.value) ** 2) for p, e in known)
    left = min(1.0, best.standard_error**2 / variance) if variance > 0 else 1.0
    shares: dict[ErrorSource, float] = {source: left * share for source, share in best.error_shares.items()}
    shares["ends"] = 1 - left
    found = replace(
        widened, standard_error=float(np.sqrt(variance)), identifiability=word, error_shares=MappingProxyType(shares)
    )
    ends = " to ".join(f"{end:.3g}" for end in found.shown.ci95)
    why = f"95 % interval {ends} {found.shown.unit} over what isn't stated of the test; stated as found, {best.why}"
    return replace(found, why=why)


def _mixed(known: Sequence[tuple[float, Estimate]], level: float) -> float:
    """Return a quantile of a mixture; each side of an interval is half of a normal distribution."""

    def below(value: float) -> float:
        total = 0.0
        for probability, one in known:
            low, high = one.ci95
            side = one.value - low if value < one.value else high - one.value
            total += probability * norm.cdf(1.96 * (value - one.value) / max(side, 1e-12 * abs(one.value) + 1e-300))
        return total - level

    ends = [end for _, one in known for end in (2 * one.ci95[0] - one.value, 2 * one.ci95[1] - one.value)]
    low, high = min(ends), max(ends)
    if below(low) > 0 or below(high) < 0:
        return low if below(low) > 0 else high
    return float(brentq(below, low, high))


def alternatives_text(every: Sequence[Weighed], to_know: str) -> str:
    """Return what the recordings say of a test's alternatives, what that costs, and how to narrow it."""
    best, *others = every
    chances = ", ".join(f"{one.words} ({100 * one.probability:.0f} %)" for one in every)
    text = f"What isn't stated of the test is weighed by the recordings: {chances}."
    name = DEEP_C10 if DEEP_C10 in best.estimates else next(iter(best.estimates))
    value = best.estimates[name].value
    moves = ", ".join(
        f"{100 * (one.estimates[name].value / value - 1):+.0f} % with {one.words}"
        for one in others
        if name in one.estimates and value
    )
    low, high = best.estimates[name].ci95
    alone = 50 * (high - low) / value if value else 0.0
    return (
        f"{text} {symbol_of(name)} is that of the first, and would be {moves}; its interval goes over all. If that "
        f"were known, ± {alone:.1f} % would be left. {to_know}."
    )

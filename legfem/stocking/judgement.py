"""How well the stiffness of muscle and fat is known, and whether all starts found the same."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from legfem.inverse.intervals import Bound, Identifiability, bound_of, quantile, verdict_on
from legfem.stocking.accuracy import ContourAccuracy
from legfem.stocking.identification import Identified
from legfem.stocking.leg_model import PARAMETERS
from legfem.stocking.stiffnesses import BOUNDS

SAME_WITHIN, SAME_WITHIN_INTERVAL = 0.02, 0.2
"""Relative difference up to which two searches found the same stiffness: either of a share of it,
and of the half width of its 95 % interval."""
MISSED_BEYOND = 1.5
"""Root-mean-square distance, over that of the outlines' errors, beyond which the model misses the
scan: then its intervals don't hold."""


@dataclass(frozen=True)
class KnownStiffness:
    """How well one stiffness is known; MPa."""

    name: str
    """Of `PARAMETERS`."""
    value: float
    interval95: tuple[float, float]
    """0 and infinity where it is open."""
    half_width: float
    """Of the interval, over the value."""
    at_bound: Bound
    verdict: Identifiability


def expected_rms(accuracy: ContourAccuracy) -> float:
    """Return the root-mean-square distance (mm) that errors of the contours alone make."""
    return math.sqrt(2 * accuracy.smoothed_sd**2 + accuracy.model_sd**2)


def model_misses(found: Identified, accuracy: ContourAccuracy) -> bool:
    """Tell whether the best fit is farther from the scan than errors of the contours explain."""
    return not found.rms <= MISSED_BEYOND * expected_rms(accuracy)


def judge(found: Identified, accuracy: ContourAccuracy) -> tuple[KnownStiffness, ...]:
    """Return how well each stiffness is known, in the order of `PARAMETERS`.

    Its interval decides. One at a bound of the search isn't known; one of a model that misses the
    scan, or of a search that didn't end, is weakly so at best.
    """
    intervals = found.interval95
    missed = not found.converged or model_misses(found, accuracy)
    known = []
    for number, name in enumerate(PARAMETERS):
        value = float(found.parameters[number])
        low, high = (math.nan, math.nan) if intervals is None else map(float, intervals[number])
        half = 0.5 * (high - low) / value
        bound = bound_of(value, BOUNDS, within=1e-6)
        verdict = verdict_on(half, bound, model_fits=not missed)
        known.append(KnownStiffness(name, value, (low, high), half, bound, verdict))
    return tuple(known)


def starts_agree(searches: Sequence[Identified]) -> bool:
    """Tell whether searches, the best first, led to the same stiffness."""
    values = np.log([search.parameters for search in searches])
    allowed = np.full(len(PARAMETERS), SAME_WITHIN)
    if (covariance := searches[0].log_covariance) is not None:
        half = quantile(0) * np.sqrt(np.diag(covariance))
        allowed = np.maximum(allowed, SAME_WITHIN_INTERVAL * half)
    return bool((np.ptp(values, axis=0) <= allowed).all())

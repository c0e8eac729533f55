"""Sizes of errors that differ from trial to trial, from the differences between repeats."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import LinAlgError, cholesky, helmert, solve_triangular
from scipy.optimize import minimize

from legfem.common.units import FloatArray

_FACTOR = 5.0
"""Natural logarithm of how far sizes may lie from what is expected, either way."""
_IMPOSSIBLE = 1e12


@dataclass(frozen=True, eq=False)
class Differences:
    """Differences between the repeats of one programme."""

    contrasts: FloatArray
    """(m, R - 1), N: orthonormal contrasts between R trials; see `contrasts_of`."""
    covariance: Callable[[FloatArray], FloatArray]
    """Of one trial's values, (m, m), N^2, by the sizes (k,)."""


def contrasts_of(values: FloatArray) -> FloatArray:
    """Return (n, R - 1): what R trials (R, n) differ by; the true curve isn't in it.

    Helmert's contrasts are orthonormal: each has the covariance of one trial.
    """
    return np.asarray((helmert(len(values)) @ values).T)


def sizes_from_repeats(expected: FloatArray, vagueness: ArrayLike, differences: Sequence[Differences]) -> FloatArray:
    """Return the sizes (k,) that maximise the differences' likelihood times what is expected.

    Expectations are log-normal: they keep two or three repeats that happen to agree from claiming
    certainty.

    Parameters
    ----------
    expected
        (k,): medians of what is expected.
    vagueness
        Their log-standard deviations, (k,) or one for all.
    differences
        Of each programme that was repeated.
    """

    def cost(logs: FloatArray) -> float:
        total = 0.5 * float(np.sum((logs / np.asarray(vagueness)) ** 2))
        for one in differences:
            try:
                lower = cholesky(one.covariance(expected * np.exp(logs)), lower=True)
            except LinAlgError:
                return _IMPOSSIBLE
            white = solve_triangular(lower, one.contrasts, lower=True)
            log_det = 2 * float(np.sum(np.log(np.diag(lower))))
            total += 0.5 * (one.contrasts.shape[1] * log_det + float(np.sum(white**2)))
        return total

    bounds = [(-_FACTOR, _FACTOR)] * len(expected)
    found = minimize(cost, np.zeros(len(expected)), method="L-BFGS-B", bounds=bounds)
    return np.asarray(expected * np.exp(found.x))

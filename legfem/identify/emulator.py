r"""A smooth stand-in for the forward model, through its solved values and exact derivatives.

Gradient-enhanced kriging of :math:`\ln F(d_i)` at all grid points :math:`d_i` at once, in the
coordinates of `coordinates`, about a linear trend, with a squared-exponential covariance whose two
lengths are those of the greatest likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import cho_factor, cho_solve

from legfem.units import FloatArray

_LENGTHS = (0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6)
# Over the process' variance. The solved curve is a spline through adaptive steps, so that it is
# smooth in the stiffness to some 1e-4 only; less makes neighbouring samples contradict each other.
_NUGGET = 1e-8
_SMALLEST_FORCE_N = 1e-9


def coordinates(c10: ArrayLike, c20: ArrayLike) -> FloatArray:
    """Return the emulator's coordinates (..., 2) of stiffnesses in kPa.

    ``ln C10`` and ``ln(1 + C20 / C10)``: the first carries the scale of all stiffnesses, the second
    is 0 for a neo-Hookean tissue and stays smooth where C20 rules.
    """
    first, second = np.broadcast_arrays(np.asarray(c10, float), np.asarray(c20, float))
    return np.stack([np.log(first), np.log1p(second / first)], axis=-1)


def _coordinate_derivatives(c10: FloatArray, c20: FloatArray) -> FloatArray:
    """Return the derivatives of (c10, c20) by the coordinates; (n, 2, 2), kPa."""
    first = np.stack([c10, np.zeros_like(c10)], axis=-1)
    return np.stack([first, np.stack([c20, c10 + c20], axis=-1)], axis=-2)


@dataclass(frozen=True, eq=False)
class Samples:
    """Solved points: forces on the grid and their derivatives."""

    c10: FloatArray
    """(n,), kPa."""
    c20: FloatArray
    """(n,), kPa."""
    force: FloatArray
    """(n, m), N."""
    by_c10: FloatArray
    """(n, m), N/kPa."""
    by_c20: FloatArray
    """(n, m), N/kPa."""


class Emulator:
    """Force on a grid of displacement for any stiffness, from solved samples.

    Parameters
    ----------
    samples : Samples
        At least two.
    dimensions : int
        1 where C20 is always 0, else 2.
    """

    def __init__(self, samples: Samples, dimensions: int) -> None:
        self.samples, self.dimensions = samples, dimensions
        force = np.maximum(samples.force, _SMALLEST_FORCE_N)
        chain = _coordinate_derivatives(samples.c10, samples.c20)
        by = np.stack([samples.by_c10, samples.by_c20], axis=1)
        slopes = np.einsum("nkm,nkj->njm", by, chain) / force[:, None, :]
        self._at = coordinates(samples.c10, samples.c20)[:, :dimensions]
        self._values = np.vstack([np.log(force), *(slopes[:, j, :] for j in range(dimensions))])
        self._trend = _trend(self._at, derivatives=True)

    def __call__(self, c10: ArrayLike, c20: ArrayLike) -> FloatArray:
        """Return the force (..., m) in N at stiffnesses in kPa."""
        at = coordinates(c10, c20)[..., : self.dimensions]
        flat = at.reshape(-1, self.dimensions)
        covariance = _covariance(flat, self._at, self._fit.lengths, rows=False)
        log_force = covariance @ self._fit.weights + _trend(flat, False) @ self._fit.trend
        # Far outside the samples the trend may run away.
        log_force = np.clip(log_force, -30.0, 30.0)
        return np.asarray(np.exp(log_force)).reshape(*at.shape[:-1], -1)

    @cached_property
    def _fit(self) -> _Fit:
        fits = [
            self._fitted(np.array(lengths)) for lengths in product(_LENGTHS, repeat=self.dimensions)
        ]
        return max(fits, key=lambda fit: fit.log_likelihood)

    def _fitted(self, lengths: FloatArray) -> _Fit:
        covariance = _covariance(self._at, self._at, lengths, rows=True)
        covariance += _NUGGET * np.eye(len(covariance))
        factor = cho_factor(covariance, lower=True)
        whitened = cho_solve(factor, self._trend)
        normal = self._trend.T @ whitened
        trend = np.linalg.solve(normal, whitened.T @ self._values)
        rest = self._values - self._trend @ trend
        weights = cho_solve(factor, rest)
        n, m = self._values.shape
        variance = max(float(np.sum(rest * weights)) / (n * m), 1e-300)
        log_determinant = 2 * float(np.sum(np.log(np.diag(factor[0]))))
        return _Fit(lengths, weights, trend, -n * np.log(variance) - log_determinant)


@dataclass(frozen=True, eq=False)
class _Fit:
    lengths: FloatArray
    weights: FloatArray
    trend: FloatArray
    log_likelihood: float


def _trend(at: FloatArray, derivatives: bool) -> FloatArray:
    n, p = at.shape
    value = np.hstack([np.ones((n, 1)), at])
    if not derivatives:
        return value
    slopes = [np.tile(np.eye(p + 1)[j + 1], (n, 1)) for j in range(p)]
    return np.vstack([value, *slopes])


def _covariance(a: FloatArray, b: FloatArray, lengths: FloatArray, rows: bool) -> FloatArray:
    """Return the covariance of values (and with ``rows`` derivatives) at a with both at b."""
    inverse = 1 / lengths**2
    apart = a[:, None, :] - b[None, :, :]
    k = np.exp(-0.5 * np.einsum("ijp,p->ij", apart**2, inverse))
    p = len(lengths)
    by_b = [apart[:, :, q] * inverse[q] * k for q in range(p)]
    top = np.hstack([k, *by_b])
    if not rows:
        return top
    blocks = [top]
    for q in range(p):
        line = [-by_b[q]]
        for r in range(p):
            kronecker = inverse[q] if q == r else 0.0
            line.append((kronecker - apart[:, :, q] * apart[:, :, r] * inverse[q] * inverse[r]) * k)
        blocks.append(np.hstack(line))
    return np.vstack(blocks)

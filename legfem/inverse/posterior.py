"""Posterior distributions of parameters: normal, within bounds, and mixtures of them.

Bounds are taken up by expectation propagation: each by a normal factor with the truncated distribution's own moments,
one parameter after the other until nothing changes. J. P. Cunningham, P. Hennig, S. Lacoste-Julien, Gaussian
probabilities and expectation propagation (2011), arXiv:1111.6832.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.optimize import brentq
from scipy.special import log_ndtr, ndtr, stdtr

from legfem.common.units import FloatArray


@dataclass(frozen=True, eq=False)
class MixtureComponents:
    """Distributions of p parameters as m normal ones by weight."""

    weights: FloatArray
    """(m,), of sum one."""
    means: FloatArray
    """(m, p)."""
    sds: FloatArray
    """(m, p)."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """What the data say of an explanation."""

    log_evidence: float
    mean: FloatArray
    """(p,): departures, within their bounds."""
    covariance: FloatArray
    """(p, p)."""
    discrepancy_probability: float
    """Probability that something unknown is left beside it."""
    discrepancy_size: float
    """Its expected standard deviation over the largest force, where there is something."""
    gain_sd: float
    zero_sd: float
    """Expected sizes (N) of the trials' gains and zeros."""
    effects: FloatArray
    """(k,): expected effects of what the model doesn't know, in standard deviations."""
    discrepancy_weights: FloatArray
    """(u,): probabilities of the unknown errors, none among them."""
    components: MixtureComponents | None = None
    """The parameters' distributions, where these are no normal ones."""


def mixed(total: float, weights: FloatArray, parts: Sequence[Posterior]) -> Posterior:
    """Return a mixture's moments.

    Parameters
    ----------
    total
        Logarithm of its evidence.
    weights
        (m,), of sum one.
    parts
        m of the same parameters.
    """
    mean, spread = moments_of(weights, np.array([p.mean for p in parts]), np.array([p.covariance for p in parts]))
    names = "discrepancy_probability", "discrepancy_size", "gain_sd", "zero_sd", "effects", "discrepancy_weights"
    return Posterior(total, mean, spread, *(weights @ np.array([getattr(p, name) for p in parts]) for name in names))


def moments_of(weights: FloatArray, means: FloatArray, covariances: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean (p,) and covariance (p, p) of a mixture of m, of means (m, p)."""
    mean = weights @ means
    apart = means - mean
    spread = np.tensordot(weights, covariances, 1) + np.einsum("m,mi,mj->ij", weights, apart, apart)
    return np.asarray(mean), np.asarray(spread)


_FAR = 99.0
"""Standard deviations beyond which no quantile lies."""
_AS_NORMAL = 1e4
"""Degrees of freedom from which Student's distribution is the normal one."""
_CLOSE_TO = 1e-6
"""Of a quantile, in standard deviations of what was known beforehand."""
_TRIFLE = 1e-7
"""Of the greatest weight: what no quantile depends on."""


@dataclass(frozen=True, eq=False)
class Mixture:
    """One parameter's distribution: m Student's t (normal ones of infinite degrees) by weight.

    Parameters
    ----------
    weights
        (m,), of sum one.
    means, sds
        (m,).
    degrees
        (m,), of freedom.
    """

    weights: FloatArray
    means: FloatArray
    sds: FloatArray
    degrees: FloatArray

    @classmethod
    def joined(cls, weights: Sequence[float], every: Sequence["Mixture"]) -> Self:
        """Return the mixture of mixtures, their weights of any sum."""
        total = sum(weights)
        return cls(
            np.concatenate([w / total * m.weights for w, m in zip(weights, every, strict=True)]),
            *(np.concatenate([getattr(m, name) for m in every]) for name in ("means", "sds", "degrees")),
        )

    def merged(self, most: int) -> "Mixture":
        """Return the mixture of so many at most: neighbours along a strength are one of their moments."""
        there = Mixture(*(part[self.weights > 0.0] for part in (self.weights, self.means, self.sds, self.degrees)))
        at = np.arange(0, len(there.weights), -(-len(there.weights) // most))
        weights = np.add.reduceat(there.weights, at)
        means = np.add.reduceat(there.weights * there.means, at) / weights
        apart = there.means - np.repeat(means, np.diff(at, append=len(there.means)))
        variances = np.add.reduceat(there.weights * (there.sds**2 + apart**2), at) / weights
        return Mixture(weights, means, np.sqrt(variances), np.minimum.reduceat(there.degrees, at))

    @property
    def moments(self) -> tuple[float, float]:
        """Mean and variance, were all of them normal."""
        mean = float(self.weights @ self.means)
        return mean, float(self.weights @ (self.sds**2 + (self.means - mean) ** 2))

    def narrowed(self, factor: float) -> "Mixture":
        """Return the same about its mean with a factor on its width."""
        mean, _ = self.moments
        return replace(self, means=mean + factor * (self.means - mean), sds=factor * self.sds)

    def below(self, value: float) -> float:
        """Return the probability that the parameter lies below a value."""
        at, normal = (value - self.means) / self.sds, self.degrees > _AS_NORMAL
        each = np.where(normal, ndtr(at), 0.0)
        each[~normal] = stdtr(self.degrees[~normal], at[~normal])
        return float(self.weights @ each)

    def quantile(self, probability: float) -> float:
        """Return the value below which the parameter lies with a probability."""
        kept = self.weights > _TRIFLE * self.weights.max()
        share = self.weights[kept] / self.weights[kept].sum()
        most = Mixture(share, self.means[kept], self.sds[kept], self.degrees[kept])
        low = float((most.means - _FAR * most.sds).min())
        high = float((most.means + _FAR * most.sds).max())
        return float(brentq(lambda value: most.below(value) - probability, low, high, xtol=_CLOSE_TO))


_ROUNDS, _CLOSE = 30, 1e-6
_INSIDE = 6.0
"""Standard deviations from which a bound cuts nothing off."""
_TAIL = 20.0
"""Standard deviations beyond which a tail is exponential."""
_FLATTEST = 1e-10
"""Least precision of a factor: where a bound cuts next to nothing, rounding may make it less."""


def within(
    mean: FloatArray, covariance: FloatArray, low: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the moments of a normal distribution within bounds.

    Parameters
    ----------
    mean, covariance
        (p,) and (p, p): without the bounds.
    low, high
        (p,): between which values are possible; infinite where there is no end.
    """
    at, spread = mean.copy(), covariance.copy()
    precision, shift = np.zeros(len(mean)), np.zeros(len(mean))
    sd = np.sqrt(np.diag(covariance))
    cut = np.flatnonzero((low > mean - _INSIDE * sd) | (high < mean + _INSIDE * sd))
    for _ in range(_ROUNDS):
        before = at.copy()
        for k in cut:
            # By rounding: the bounds leave nothing else to know.
            if spread[k, k] <= 0.0 or spread[k, k] * precision[k] >= 1.0:
                continue
            without = 1.0 / (1.0 / spread[k, k] - precision[k])
            middle = without * (at[k] / spread[k, k] - shift[k])
            inside, variance = _truncated(middle, without, low[k], high[k])
            more = max(1.0 / variance - 1.0 / without, _FLATTEST) - precision[k]
            pull = inside / variance - middle / without - shift[k]
            column = spread[:, k] / (1.0 + more * spread[k, k])
            at = at + column * (pull - more * at[k])
            spread = spread - more * np.outer(column, spread[:, k])
            precision[k] += more
            shift[k] += pull
        if np.all(np.abs(at - before) <= _CLOSE * sd):
            break
    return at, spread


_LOG_ROOT = 0.5 * float(np.log(2 * np.pi))


def _truncated(mean: float, variance: float, low: float, high: float) -> tuple[float, float]:
    """Return the mean and variance of one normal variable between two ends."""
    sd = float(np.sqrt(variance))
    first, last = (low - mean) / sd, (high - mean) / sd
    if last < -_TAIL:
        inside, spread = _truncated(0.0, 1.0, -last, -first)
        return mean - sd * inside, variance * spread
    if first > _TAIL:
        # The density falls exponentially there.
        away = min(1.0 / first, 0.5 * (last - first))
        return mean + sd * (first + away), variance * away**2
    # As scipy.stats.truncnorm has them, whose objects take a hundred times as long to make.
    low, high = (-last, -first) if first > 0.0 else (first, last)
    log_mass = log_ndtr(high) + np.log1p(-np.exp(log_ndtr(low) - log_ndtr(high)))
    at_first, at_last = (np.exp(-0.5 * end**2 - _LOG_ROOT - log_mass) for end in (first, last))
    inside = float(at_first - at_last)
    parts = [(end - inside) * p for end, p in ((first, at_first), (last, -at_last)) if p != 0.0]
    return mean + sd * inside, variance * (1.0 + float(sum(parts)))

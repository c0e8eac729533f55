"""What data say of a model's parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

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
    unknown: float
    """Probability that something unknown is left beside it."""
    unknown_size: float
    """Its expected standard deviation over the largest force, where there is something."""
    gain_sd: float
    zero_sd: float
    """Expected sizes (N) of the trials' gains and zeros."""
    effects: FloatArray
    """(k,): expected effects of what the model doesn't know, in standard deviations."""
    of_unknown: FloatArray
    """(u,): probabilities of the unknown errors, none among them."""
    strands: MixtureComponents | None = None
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

    def average(name: str) -> float:
        return float(sum(w * getattr(p, name) for w, p in zip(weights, parts, strict=True)))

    return Posterior(
        log_evidence=total,
        mean=mean,
        covariance=spread,
        unknown=average("unknown"),
        unknown_size=average("unknown_size"),
        of_unknown=_averaged(weights, [p.of_unknown for p in parts]),
        gain_sd=average("gain_sd"),
        zero_sd=average("zero_sd"),
        effects=_averaged(weights, [p.effects for p in parts]),
    )


def moments_of(weights: FloatArray, means: FloatArray, covariances: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean (p,) and covariance (p, p) of a mixture of m, of means (m, p)."""
    mean = weights @ means
    apart = means - mean
    spread = np.tensordot(weights, covariances, 1) + np.einsum("m,mi,mj->ij", weights, apart, apart)
    return np.asarray(mean), np.asarray(spread)


def _averaged(weights: FloatArray, values: Sequence[FloatArray]) -> FloatArray:
    return np.asarray(weights @ np.array(values))

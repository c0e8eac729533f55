"""Distributions of parameters that are no normal ones: sums of these by weight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.optimize import brentq
from scipy.stats import t as student_t

from legfem.common.units import FloatArray

_FAR = 99.0
"""Standard deviations beyond which no quantile lies."""


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
    def joined(cls, weights: Sequence[float], every: Sequence[Mixture]) -> Self:
        """Return the mixture of mixtures, their weights of any sum."""
        total = sum(weights)
        return cls(
            np.concatenate([w / total * m.weights for w, m in zip(weights, every, strict=True)]),
            *(np.concatenate([getattr(m, name) for m in every]) for name in ("means", "sds", "degrees")),
        )

    @property
    def moments(self) -> tuple[float, float]:
        """Mean and variance, were all of them normal."""
        mean = float(self.weights @ self.means)
        return mean, float(self.weights @ (self.sds**2 + (self.means - mean) ** 2))

    def below(self, value: float) -> float:
        """Return the probability that the parameter lies below a value."""
        each = student_t.cdf((value - self.means) / self.sds, self.degrees)
        return float(self.weights @ each)

    def quantile(self, probability: float) -> float:
        """Return the value below which the parameter lies with a probability."""
        low = float((self.means - _FAR * self.sds).min())
        high = float((self.means + _FAR * self.sds).max())
        return float(brentq(lambda value: self.below(value) - probability, low, high))

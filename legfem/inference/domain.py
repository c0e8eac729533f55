"""The box that is searched, and the genes from 0 to 1 that span it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from legfem.common.units import FloatArray
from legfem.inference.parameter import Parameter

# Of the upper bound: where a logarithmic parameter that may be 0 becomes nearly logarithmic.
_KNEE = 1 / 500
# Of the bounds' width.
_ROUNDING = 1e-14


@dataclass(frozen=True)
class Domain:
    """Bounds of parameters and their genes, each from 0 to 1.

    A gene is linear in the parameter or in its logarithm, as the parameter's scale says; where a
    logarithmic parameter may be 0, in ln(1 + value / (upper bound / 500)).

    Parameters
    ----------
    parameters : tuple of Parameter
        p of them.
    """

    parameters: tuple[Parameter, ...]

    @property
    def bounds(self) -> FloatArray:
        """Bounds (p, 2), in the parameters' units."""
        return np.array([one.bounds for one in self.parameters]).reshape(-1, 2)

    def values(self, genes: FloatArray) -> FloatArray:
        """Return the values (..., p) of genes (..., p)."""
        clipped = np.clip(genes, 0.0, 1.0)
        columns = [_value(one, clipped[..., k]) for k, one in enumerate(self.parameters)]
        return self.inside(np.stack(columns, axis=-1))

    def genes(self, values: FloatArray) -> FloatArray:
        """Return the genes (..., p) of values (..., p)."""
        columns = [_gene(one, values[..., k]) for k, one in enumerate(self.parameters)]
        return np.clip(np.stack(columns, axis=-1), 0.0, 1.0)

    def inside(self, values: FloatArray) -> FloatArray:
        """Return values (..., p), clipped to the bounds; what rounding put beside is at one."""
        low, high = self.bounds.T
        beside = _ROUNDING * (high - low)
        values = np.where(values <= low + beside, low, values)
        return np.where(values >= high - beside, high, values)


def _value(parameter: Parameter, gene: FloatArray) -> FloatArray:
    low, high = parameter.bounds
    if parameter.scale == "linear":
        return low + gene * (high - low)
    if low > 0:
        return np.exp(np.log(low) + gene * (np.log(high) - np.log(low)))
    knee = _KNEE * high
    first, last = np.log1p(low / knee), np.log1p(high / knee)
    return np.asarray(knee * np.expm1(first + gene * (last - first)))


def _gene(parameter: Parameter, value: FloatArray) -> FloatArray:
    low, high = parameter.bounds
    if parameter.scale == "linear":
        return (value - low) / (high - low)
    if low > 0:
        return (np.log(value) - np.log(low)) / (np.log(high) - np.log(low))
    knee = _KNEE * high
    first, last = np.log1p(low / knee), np.log1p(high / knee)
    return np.asarray((np.log1p(value / knee) - first) / (last - first))

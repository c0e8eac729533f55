"""A law of the tissue: what of it is free, what is held, and what is assumed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.catalogue import Values
from legfem.inverse.instrument import INSTRUMENT, READINGS
from legfem.inverse.parameter import Parameter, Priors

LawName = Literal["neo-hookean", "reduced-polynomial", "yeoh", "exponential"]


LAWS: tuple[LawName, ...] = ("neo-hookean", "reduced-polynomial")
"""Of legs; specimens take all."""


@dataclass(frozen=True, eq=False)
class IdentifiedLaw:
    """A law, what of it is free, and what is held.

    Parameters
    ----------
    name : str
        Of the deep tissue's strain energy.
    parameters : tuple of Parameter
        p free ones: identified, or nuisances that a prior holds.
    fixed : Mapping[str, float]
        Values of the model and the instrument that are held.
    nominal : Mapping[str, float]
        The model's values as assumed, for those that are neither.
    usual : Mapping[str, tuple of float]
        Where to look first, in place of where legs lie.
    """

    name: LawName
    parameters: tuple[Parameter, ...]
    fixed: Values
    nominal: Values
    usual: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Names (p) of the free parameters."""
        return tuple(one.name for one in self.parameters)

    @cached_property
    def of_model(self) -> list[int]:
        """Which of the free parameters are the model's, and not the instrument's."""
        return [k for k, name in enumerate(self.names) if name not in READINGS]

    @property
    def priors(self) -> Priors:
        """Those of the free parameters."""
        return Priors(self.parameters)

    @property
    def reads(self) -> bool:
        """Whether the instrument has free or held numbers of its own."""
        return any(name in INSTRUMENT for name in (*self.names, *self.fixed))

    def index(self, name: str) -> int | None:
        """Return which free parameter has a name."""
        return self.names.index(name) if name in self.names else None

    def values(self, point: FloatArray) -> dict[str, float]:
        """Return all values of a point (p,) of free parameters."""
        free = zip(self.names, map(float, point), strict=True)
        return {**self.fixed, **dict(free)}

    def point(self, values: Values) -> FloatArray:
        """Return the free parameters (p,) of values."""
        return np.array([values[name] for name in self.names])

    def column(self, points: FloatArray, name: str) -> FloatArray:
        """Return a value (...) at points (..., p), free or held."""
        index = self.index(name)
        if index is not None:
            return np.asarray(points[..., index])
        null = READINGS[name].null if name in READINGS else self.nominal.get(name, 0.0)
        return np.full(points.shape[:-1], self.fixed.get(name, null))

    def readings(self, points: FloatArray) -> FloatArray:
        """Return the numbers (..., k) of `READINGS` at points (..., p)."""
        return np.stack([self.column(points, name) for name in READINGS], axis=-1)


def model_values(values: Values) -> dict[str, float]:
    """Return what of values is the model's."""
    return {name: value for name, value in values.items() if name not in READINGS}

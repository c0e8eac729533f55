"""Parameters of a model or an instrument: what is known of them beforehand, and the box that is searched."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from legfem.common.units import FloatArray

Role = Literal["identified", "nuisance", "fixed"]
Scale = Literal["linear", "log"]
Normal = Literal["linear", "log", "tailed"]
"""What is normal of a parameter: it, its logarithm, or the inverse hyperbolic sine of its departure: as the first where
that is small, and as likely to be ten standard deviations off as a normal one three."""


@dataclass(frozen=True)
class Prior:
    """What is known of a parameter before the test: a normal distribution of it or of its logarithm.

    Parameters
    ----------
    centre : float
        Mean, or median of a logarithmic one; in the parameter's unit.
    sd : float
        Standard deviation, in the parameter's unit or of the natural logarithm.
    scale : {"linear", "log", "tailed"}
        What is normal, see `Normal`.
    source : str
        Where that is known from.
    """

    centre: float
    sd: float
    scale: Normal = "linear"
    source: str = ""

    def __post_init__(self) -> None:
        """Raise ValueError for a width that isn't positive, or a logarithm that doesn't exist."""
        if not (self.sd > 0 and math.isfinite(self.sd) and math.isfinite(self.centre)):
            raise ValueError("a prior needs a finite centre and a positive standard deviation")
        if self.scale == "log" and self.centre <= 0:
            raise ValueError("the median of a logarithmic prior is positive")

    def departure[Value: (float, FloatArray)](self, value: Value) -> Value:
        """Return how far a value lies from the centre, in standard deviations."""
        if self.scale != "log":
            off = (value - self.centre) / self.sd
            return off if self.scale == "linear" else np.arcsinh(off)
        with np.errstate(divide="ignore"):
            return np.log(np.maximum(value, 0.0) / self.centre) / self.sd

    def width(self, value: float) -> float:
        """Return the standard deviation about a value, in the parameter's unit."""
        if self.scale == "log":
            return self.sd * value
        return math.hypot(self.sd, value - self.centre) if self.scale == "tailed" else self.sd

    def value_at(self, departure: float) -> float:
        """Return the value that lies so many standard deviations from the centre."""
        if self.scale != "log":
            return self.centre + self.sd * (departure if self.scale == "linear" else math.sinh(departure))
        return self.centre * math.exp(departure * self.sd)


@dataclass(frozen=True)
class Parameter:
    """A number that a prediction depends on.

    Parameters
    ----------
    name : str
        Full name in the model: ``deep.C10``, ``indenter.direction``, ``trial2.gain``.
    unit : str
        Of its values; that of the model (MPa, 1/MPa, mm) for a model's parameter.
    bounds : tuple of float
        What it lies between.
    prior : Prior, optional
        What is known beforehand; nothing within the bounds without it.
    role : {"identified", "nuisance", "fixed"}
        Whether its value is asked for, is only allowed to err, or stands.
    scale : {"linear", "log"}
        What a search steps in.
    statement : str
        What it is, in words.
    """

    name: str
    unit: str
    bounds: tuple[float, float]
    prior: Prior | None = None
    role: Role = "identified"
    scale: Scale = "linear"
    statement: str = ""

    def __post_init__(self) -> None:
        """Raise ValueError for bounds out of order."""
        low, high = self.bounds
        if not low < high:
            raise ValueError(f"{self.name}: bounds {low:g}, {high:g} are out of order")

    def inside(self, value: float) -> float:
        """Return a value, clipped to the bounds."""
        return min(max(value, self.bounds[0]), self.bounds[1])


@dataclass(frozen=True)
class Priors:
    """The priors of parameters as further residuals, one for each parameter that has one.

    Parameters
    ----------
    parameters : tuple of Parameter
        p of them, k with a prior.
    """

    parameters: tuple[Parameter, ...]

    def __len__(self) -> int:
        """Return k."""
        return len(self._known)

    @property
    def _known(self) -> list[tuple[int, Prior]]:
        """Numbers of the parameters that have a prior, with it."""
        return [(k, one.prior) for k, one in enumerate(self.parameters) if one.prior]

    def residual(self, values: FloatArray) -> FloatArray:
        """Return the departures (..., k), in standard deviations, of values (..., p)."""
        columns = [prior.departure(values[..., k]) for k, prior in self._known]
        return np.stack(columns, axis=-1) if columns else np.zeros((*values.shape[:-1], 0))

    def jacobian(self, values: FloatArray) -> FloatArray:
        """Return the derivatives (k, p) of the departures at values (p,)."""
        rows = np.zeros((len(self), len(self.parameters)))
        for row, (k, prior) in enumerate(self._known):
            rows[row, k] = 1 / prior.width(values[k])
        return rows


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
        columns = []
        for k, one in enumerate(self.parameters):
            to, back = _scale(one)
            first, last = map(to, one.bounds)
            columns.append(back(first + clipped[..., k] * (last - first)))
        return self.inside(np.stack(columns, axis=-1))

    def genes(self, values: FloatArray) -> FloatArray:
        """Return the genes (..., p) of values (..., p)."""
        columns = []
        for k, one in enumerate(self.parameters):
            to, _ = _scale(one)
            first, last = map(to, one.bounds)
            columns.append((to(values[..., k]) - first) / (last - first))
        return np.clip(np.stack(columns, axis=-1), 0.0, 1.0)

    def inside(self, values: FloatArray) -> FloatArray:
        """Return values (..., p), clipped to the bounds; what rounding put beside is at one."""
        low, high = self.bounds.T
        beside = _ROUNDING * (high - low)
        values = np.where(values <= low + beside, low, values)
        return np.where(values >= high - beside, high, values)


def _scale(parameter: Parameter) -> tuple[Callable[[Any], Any], Callable[[Any], Any]]:
    """Return what a parameter's genes are even in, and its inverse."""
    low, high = parameter.bounds
    if parameter.scale == "linear":
        return np.asarray, np.asarray
    if low > 0:
        return np.log, np.exp
    knee = _KNEE * high
    return lambda value: np.log1p(np.asarray(value) / knee), lambda at: knee * np.expm1(at)

"""Parameters of a model or an instrument, and what is known of them beforehand."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

Role = Literal["identified", "nuisance", "fixed"]
Scale = Literal["linear", "log"]


@dataclass(frozen=True)
class Prior:
    """What is known of a parameter beforehand: a normal distribution of it or of its logarithm.

    Parameters
    ----------
    centre : float
        Mean, or median of a logarithmic one; in the parameter's unit.
    sd : float
        Standard deviation, in the parameter's unit or of the natural logarithm.
    scale : {"linear", "log"}
        What is normal.
    source : str
        Where that is known from.
    """

    centre: float
    sd: float
    scale: Scale = "linear"
    source: str = ""

    def __post_init__(self) -> None:
        """Raise ValueError for a width that isn't positive, or a logarithm that doesn't exist."""
        if not (self.sd > 0 and math.isfinite(self.sd) and math.isfinite(self.centre)):
            raise ValueError("a prior needs a finite centre and a positive standard deviation")
        if self.scale == "log" and self.centre <= 0:
            raise ValueError("the median of a logarithmic prior is positive")

    def departure(self, value: float) -> float:
        """Return how far a value lies from the centre, in standard deviations."""
        if self.scale == "linear":
            return (value - self.centre) / self.sd
        if value <= 0:
            return -math.inf
        return math.log(value / self.centre) / self.sd

    def value_at(self, departure: float) -> float:
        """Return the value that lies so many standard deviations from the centre."""
        if self.scale == "linear":
            return self.centre + departure * self.sd
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

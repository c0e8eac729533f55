"""What an identification can be told, with the defaults it is tested with."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from legfem.errors import InputError

Weighting = Literal["paper", "covariance"]


@dataclass(frozen=True)
class Bounds:
    """Where the optimum is looked for, kPa."""

    c10: tuple[float, float] = (0.02, 30.0)
    c20: tuple[float, float] = (0.0, 50.0)

    def __post_init__(self) -> None:
        """Check the order and the signs."""
        for name, (low, high), least in (("c10", self.c10, 1e-6), ("c20", self.c20, 0.0)):
            if not least <= low < high < float("inf"):
                raise InputError(
                    f"--{name}-bounds", f"{low:g} {high:g}", "is no range of stiffnesses",
                    "give two values in kPa, the lower one first; C10 must be positive",
                )  # fmt: skip


@dataclass(frozen=True)
class GeneticSettings:
    """Of pygad's genetic algorithm."""

    population: int = 48
    generations: int = 60
    tolerance: float = 1e-3
    """Relative fall of the cost below which a generation counts as saturated; the paper's."""
    saturated: int = 12
    """Generations in a row without a greater fall after which the search ends."""


@dataclass(frozen=True)
class IdentificationSettings:
    """Of one identification.

    Parameters
    ----------
    bounds : Bounds
        Of the search.
    weighting : {"paper", "covariance"}
        What is minimised: the plain sum of squares (Eq. 12), or the sum weighted with the inverse
        covariance of the measured curve.
    seed : int
        Of the genetic algorithm.
    emulator : bool
        False lets the genetic algorithm call the forward model at every evaluation.
    most_solves : int
        Full solves after which a search with an emulator ends unconverged.
    genetic, plain_genetic : GeneticSettings
        With and without an emulator.
    numerical_error : float
        Standard deviation of the forward model's own error, relative to the force: half of the
        0.5 % that its convergence study bounds it by. Part of the intervals.
    numerical_error_length : float
        Distance over which that error is correlated, mm.
    identifiable_within, weakly_within : float
        Greatest half-width of the 95 % interval, relative to the value, that is called
        identifiable and weakly identifiable.
    """

    bounds: Bounds = field(default_factory=Bounds)
    weighting: Weighting = "paper"
    seed: int = 1
    emulator: bool = True
    most_solves: int = 25
    genetic: GeneticSettings = field(default_factory=GeneticSettings)
    plain_genetic: GeneticSettings = field(
        default_factory=lambda: GeneticSettings(population=12, generations=25)
    )
    numerical_error: float = 0.0025
    numerical_error_length: float = 10.0
    identifiable_within: float = 0.03
    weakly_within: float = 0.5

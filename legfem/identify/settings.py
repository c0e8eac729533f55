"""What an identification can be told, with the defaults it is tested with."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from legfem.inference.genetic import Genetic
from legfem.inference.minimiser import Minimiser

Weighting = Literal["paper", "covariance"]


@dataclass(frozen=True)
class IdentificationSettings:
    """Of one identification.

    Parameters
    ----------
    weighting : {"paper", "covariance"}, optional
        What is minimised: the plain sum of squares (Eq. 12), or the sum weighted with the inverse
        covariance of the measured curve, against which alone a prior can be weighed. Without it
        the latter where there is a prior, else the former.
    seed : int
        Of the search.
    emulator : bool
        False lets the search call the forward model at every evaluation.
    most_solves : int
        Full solves after which a search with an emulator ends unconverged.
    minimiser, plain_minimiser : Minimiser
        The search, with and without an emulator; see `legfem.inference.minimiser`.
    """

    weighting: Weighting | None = None
    seed: int = 1
    emulator: bool = True
    most_solves: int = 25
    minimiser: Minimiser = field(default_factory=Genetic)
    plain_minimiser: Minimiser = field(default_factory=lambda: Genetic(population=12, generations=25))

"""The course of a search, as it is written and drawn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from legfem.common.units import FloatArray
from legfem.inverse.catalogue import Values


@dataclass(frozen=True)
class FullSolve:
    """One full forward solve of the search."""

    values: Values
    """Of model and instrument, in their units."""
    cost: float
    """N2 (Eq. 12); NaN where the solve stopped short."""
    stage: Literal["design", "proposal", "bound", "genetic"]
    complete: bool
    reason: str
    """Why it stopped, if short of its depth."""
    factorisations: int
    seconds: float


@dataclass(frozen=True)
class Generation:
    """The best of one generation of the genetic algorithm."""

    round: int
    """Refinement of the emulator that it searched on, from 0."""
    number: int
    values: Values
    """Of model and instrument, in their units."""
    cost: float
    """N2 on the emulator (of the full model without one)."""


@dataclass(frozen=True, eq=False)
class CostMap:
    """The cost over one or two parameters on a grid, from the emulator."""

    names: tuple[str, ...]
    """Of the parameters."""
    across: FloatArray
    """(m,), the first parameter, increasing, in its unit."""
    up: FloatArray
    """(k,), the second, likewise; a single 0 where there is none."""
    cost: FloatArray
    """(k, m), N2."""


@dataclass(frozen=True, eq=False)
class SearchLog:
    """How the optimum was found."""

    names: tuple[str, ...]
    """Of the free parameters."""
    solves: tuple[FullSolve, ...]
    """In the order in which they were asked for."""
    generations: tuple[Generation, ...]
    cost_map: CostMap | None
    """None without an emulator, or with more than two parameters."""
    converged: bool
    seed: int
    """Seed of all random numbers."""
    wall_s: float
    """Time that the search took, s."""
    emulator_error: float
    """Greatest difference between the emulator before the last solve and that solve, at the optimum, in the readings'
    unit (N); NaN without an emulator."""
    forward_solves: int
    """Full solves that the fit rests on, failed ones included."""
    failed_solves: int
    """Those of them that stopped short."""
    reused_solves: int
    """Those of them that were found on disk from an earlier run."""
    factorisations: int
    compromise: str
    """What the best solve's model gave up to go on, in words; empty if nothing."""

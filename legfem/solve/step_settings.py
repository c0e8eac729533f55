"""How long the steps along a protocol are."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class StepSettings:
    """Sizes of the steps and how they adapt; of displacement (mm) where the indenter moves.

    A step grows by ``growth`` when Newton needed at most ``easy`` factorisations, shrinks when it
    needed ``hard`` or more, and is cut by ``cut`` when it failed. A hold starts with ``hold_first``
    of its duration, no more than ``hold_first_time`` (s), and its steps grow by ``hold_growth``.

    In a loading a step is no longer than keeps a cubic spline through the steps within
    ``curve_tolerance`` of the force, by an estimate (`legfem.solve.curve_watch`); a tenth of
    ``first`` is short enough.

    Where no step converges, ``relaxes`` lets the body creep to another equilibrium
    (`legfem.solve.relaxation`), at which the force may jump.

    What a contact remembers depends on the steps, a little. Where solvers that work differently are
    to take the same ones, ``easy`` and ``hard`` have to be out of reach: see `regular`.
    """

    first: float = 0.2
    largest: float = 1.5
    smallest: float = 1e-3
    growth: float = 1.6
    shrink: float = 0.7
    cut: float = 0.4
    easy: int = 5
    hard: int = 8
    hold_first: float = 0.01
    hold_first_time: float = 0.1
    hold_growth: float = 1.3
    curve_tolerance: float = math.inf
    relaxes: bool = False

    @classmethod
    def regular(cls, **sizes: Any) -> StepSettings:
        """Return steps that grow however much work they were, and shrink only after a failure."""
        return cls(easy=sys.maxsize, hard=sys.maxsize, **sizes)

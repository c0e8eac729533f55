"""Settings of a solution: when Newton's method has converged or gives up, and how long steps are."""

import math
import sys
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class NewtonSettings:
    """When a step has converged, and when it is given up.

    Parameters
    ----------
    relative_tolerance : float
        Norm of the residual against the norm of the contact's nodal forces.
    absolute_tolerance : float
        Norm of the residual below which nothing is asked (N/mm in 2D, N in 3D).
    max_factorisations : int
        Greatest number of factorisations in one step.
    reuse : float
        The factors are used again after an iteration that reduced the residual by this factor.
    keeps_body : bool
        Whether after an easy step the next one's first tangent takes the body's part from the last before; what goes
        on from a kept state then agrees with what wasn't interrupted to the tolerance alone.
    mixing : int
        Updates by the same factors from which the next is improved, see `legfem.solve.newton`.
    floor : float
        A residual that no longer falls with new factors is rounding, and good enough below this
        multiple of the tolerance: a stiff fascia around soft tissue sums large forces to small
        ones.
    memory : int
        An update is accepted if the residual falls below the largest of this many before it.
    max_halvings : int
        Greatest number of halvings of an update that doesn't.
    damped_tolerance, damped_factorisations : float, int
        ``relative_tolerance`` and ``max_factorisations`` of a damped step, by which a body creeps to another
        equilibrium: that one alone is kept, and is as exact as all others.
    """

    relative_tolerance: float = 1e-9
    absolute_tolerance: float = 1e-13
    max_factorisations: int = 12
    reuse: float = 0.3
    keeps_body: bool = False
    mixing: int = 5
    floor: float = 10.0
    memory: int = 2
    max_halvings: int = 4
    damped_tolerance: float = 1e-2
    damped_factorisations: int = 5


@dataclass(frozen=True)
class StepSettings:
    """Sizes of the steps and how they adapt; of displacement (mm) where the indenter moves.

    A step grows by ``growth`` when Newton needed at most ``easy`` factorisations, shrinks when it
    needed ``hard`` or more, and is cut by ``cut`` when it failed. A hold starts with ``hold_first``
    of its duration, no more than ``hold_first_time`` (s), and its steps grow by ``hold_growth``.

    In a loading a step is no longer than keeps a cubic spline through the steps within
    ``curve_tolerance`` of the force, by an estimate (`legfem.solve.stepping`); a tenth of
    ``first`` is short enough.

    Where no step converges, ``relaxes`` lets the body creep to another equilibrium
    (`legfem.solve.newton`), at which the force may jump. Once steps that failed and creeping have taken more than
    ``most_astray`` factorisations the next failure is the end.

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
    most_astray: float = math.inf

    @classmethod
    def regular(cls, **sizes: Any) -> "StepSettings":
        """Return steps that grow however much work they were, and shrink only after a failure."""
        return cls(easy=sys.maxsize, hard=sys.maxsize, **sizes)

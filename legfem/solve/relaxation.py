r"""Equilibrium where a path of equilibria ends: the body creeps to another one.

Thin muscle between a stiff fascia and a bone buckles and folds. At a step's end the indenter then
rests, and backward Euler steps of a fictitious time follow

.. math:: \tau\, w\, \dot u = -R(u)

with ever smaller damping, until Newton's method converges without any: pseudo-transient
continuation [1]_. A descent passes maxima and saddles of the energy, so that what it ends at is an
equilibrium that a slow experiment would snap to; only that state, undamped, is a result.

References
----------
.. [1] C. T. Kelley, D. E. Keyes, "Convergence analysis of pseudo-transient continuation", SIAM J.
   Numer. Anal. 35 (1998) 508-523.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from legfem.fem.system import System
from legfem.solve.newton import Damping, NewtonOutcome, NewtonSolver

REASON = "relaxed to another equilibrium"


@dataclass(frozen=True)
class RelaxationSettings:
    """How the damping falls; in multiples of the tangent's usual diagonal.

    Parameters
    ----------
    first, greatest : float
        Strength at the start, and above which it is given up.
    undamped : float
        Strength below which Newton's method is tried without damping.
    easy : int
        Factorisations up to which a damped step was easy: the next has ``eased`` times its
        strength. One that failed is repeated with ``raised`` times its strength.
    eased, raised : float
        Factors.
    most : int
        Greatest number of damped steps.
    """

    first: float = 1.0
    greatest: float = 1e4
    undamped: float = 1e-4
    easy: int = 6
    eased: float = 0.3
    raised: float = 8.0
    most: int = 110


def relax(system: System, solver: NewtonSolver, settings: RelaxationSettings | None = None) -> NewtonOutcome:
    """Creep from the system's present unknown to an equilibrium, which replaces it if found.

    Returns
    -------
    NewtonOutcome
        Outcome of the last solution, with the factorisations and iterations of all.
    """
    given = settings or RelaxationSettings()
    unknown = system.unknown.x.array
    factorisations = iterations = 0
    strength = given.first
    outcome = NewtonOutcome(False, "no damping was enough", 0, 0, float("inf"))
    for _ in range(given.most):
        anchor = unknown.copy()
        damped = strength >= given.undamped
        outcome = solver.solve(Damping(anchor, strength) if damped else None)
        factorisations += outcome.factorisations
        iterations += outcome.iterations
        if outcome.converged and not damped:
            outcome = replace(outcome, reason=REASON)
            break
        if outcome.converged:
            strength *= given.eased if outcome.factorisations <= given.easy else 1.0
            continue
        unknown[:] = anchor
        strength *= given.raised
        if strength > given.greatest:
            break
    else:
        outcome = replace(outcome, converged=False, reason="creeps on")
    return replace(outcome, factorisations=factorisations, iterations=iterations)

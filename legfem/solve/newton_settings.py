"""When Newton's method has converged, and when it gives up."""

from __future__ import annotations

from dataclasses import dataclass


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
        In one step.
    reuse : float
        The factors are used again after an iteration that reduced the residual by this factor.
    mixing : int
        Updates by the same factors from which the next is improved, see `legfem.solve.mixing`.
    floor : float
        A residual that no longer falls with new factors is rounding, and good enough below this
        multiple of the tolerance: a stiff fascia around soft tissue sums large forces to small
        ones.
    memory : int
        An update is accepted if the residual falls below the largest of this many before it.
    max_halvings : int
        Of an update that doesn't.
    damped_tolerance : float
        As ``relative_tolerance``, of a damped step.
    """

    relative_tolerance: float = 1e-9
    absolute_tolerance: float = 1e-13
    max_factorisations: int = 12
    reuse: float = 0.3
    mixing: int = 5
    floor: float = 10.0
    memory: int = 2
    max_halvings: int = 4
    damped_tolerance: float = 1e-6

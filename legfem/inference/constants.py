"""Numbers that inference rests on, each with its source."""

from __future__ import annotations

from typing import Literal

from scipy.special import stdtrit

NUMERICAL_ERROR = 0.0025
"""Standard deviation of the forward model's error relative to its force. The convergence study
bounds it by 0.5 % (`python -m legfem.study convergence`), and another code's curves lie within
0.35 % (`tests/verification/test_other_code.py`)."""
NUMERICAL_LENGTH_MM = 10.0
"""Displacement over which that error is correlated: so slowly do those differences change."""
PRIOR_DOF = 10
"""Degrees of freedom that a data sheet's figures are worth: a standard deviation known to some
20 % (JCGM 100:2008, G.4.2)."""
IDENTIFIABLE_WITHIN = 0.1
"""Half-width of the 95 % interval over the value up to which a parameter is called identifiable:
a third of how persons of one group differ (30 to 50 % in Frauziols et al., Table 5)."""
WEAKLY_WITHIN = 0.5
"""The same for weakly identifiable: the interval then still tells soft from stiff."""

Identifiability = Literal["identifiable", "weakly identifiable", "not identifiable"]
VERDICTS: tuple[Identifiability, ...] = ("identifiable", "weakly identifiable", "not identifiable")
"""From best to worst."""


def quantile(repeat_dof: int) -> float:
    """Return Student's two-sided 95 % quantile for a covariance known from so many repeats."""
    return float(stdtrit(PRIOR_DOF + repeat_dof, 0.975))


def identifiability(half_width: float) -> Identifiability:
    """Return the word for a 95 % interval's half-width over the value."""
    if half_width <= IDENTIFIABLE_WITHIN:
        return "identifiable"
    return "weakly identifiable" if half_width <= WEAKLY_WITHIN else "not identifiable"

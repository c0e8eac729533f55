r"""How far a spline through the solved steps is from the curve between them.

Through the last four of them goes a cubic, whose error is

.. math:: F(d) - p(d) = F[d_{n-4}, \ldots, d_n]\,(d - d_{n-3}) \cdots (d - d_n)

with the divided difference of the last five. That one belongs to the middle of them: where the last
two have the same sign and grow, as near a bone, it is taken to grow once more.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from legfem.common.units import FloatArray

MOST_GROWTH = 4.0
"""Of the divided difference from step to step that is believed."""
CLOSEST = 0.2
"""Of steps to each other, over the new one's length: noise of close ones would be blown up."""
FACTOR_UNIT = 1 / 32
"""Of a step on the one before."""
FIRST_NOISE = 4.0
"""Over the tolerance: what the first divided difference may show, since the curve starts at a kink
and the skin's first nodes close one after another."""


class CurveWatch:
    """The solved steps of one loading, and what the next should be.

    Parameters
    ----------
    tolerance
        Greatest error between steps, relative to the force there.
    """

    def __init__(self, tolerance: float) -> None:
        self._tolerance = tolerance
        self.points: list[tuple[float, float]] = []
        """Displacement (mm) and force of the steps that are solved."""
        self.bends = False
        """Whether a step was too long: the next ones aren't longer than foreseen."""

    def start(self, displacement: float, force: float) -> None:
        """Begin a loading, or begin anew after a jump."""
        self.points, self.bends = [(displacement, force)], False

    def excess(self, displacement: float, force: float) -> float:
        """Return the error up to a new step over the tolerance; 0 where it can't be told."""
        d, f = np.array([*self._spread(displacement), (displacement, force)]).T
        if len(d) < 5 or f[-2:].min() <= 0:
            return 0.0
        noise = FIRST_NOISE if len(d) == 5 else 1.0
        return curve_error(d, f) / (noise * self._tolerance)

    def _spread(self, displacement: float) -> list[tuple[float, float]]:
        """Return the last five steps that aren't much closer together than the new one is long."""
        kept: list[tuple[float, float]] = []
        apart = CLOSEST * (displacement - self.points[-1][0])
        for point in reversed(self.points):
            if not kept or kept[-1][0] - point[0] >= apart:
                kept.append(point)
        return kept[4::-1]

    def factor(self, excess: float) -> float:
        """Return the factor on a step that brings its error to the tolerance, with some room.

        In coarse units, lest steps hang on the force's rounding.
        """
        factor = np.clip(0.9 * max(excess, 1e-3) ** -0.25, 0.4, 2.0)
        return float(np.round(factor / FACTOR_UNIT) * FACTOR_UNIT)


def curve_error(displacement: FloatArray, force: FloatArray) -> float:
    """Return the greatest relative error of a spline between the last two of five steps or six.

    Parameters
    ----------
    displacement, force : ndarray
        (5,) or (6,), mm and N.
    """
    order = 4
    differences = force
    for k in range(1, order + 1):
        differences = np.diff(differences) / (displacement[k:] - displacement[:-k])
    growth = max((now / before for before, now in pairwise(differences) if now * before > 0), default=1.0)
    within = np.linspace(displacement[-2], displacement[-1], 11)[1:-1]
    product = np.prod([within - d for d in displacement[-order:]], axis=0)
    between = np.interp(within, displacement[-2:], force[-2:])
    error = np.abs(differences[-1] * product / between).max()
    return float(error * np.clip(growth, 1.0, MOST_GROWTH))

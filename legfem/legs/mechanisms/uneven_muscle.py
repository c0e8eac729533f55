"""A region of the muscle is stiffer or softer than the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.mechanism import IndentedLeg, Solution, TissueMechanism, Values, factor
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter, Prior

_DEPTHS_MM, _SIDES_MM = (6.0, 18.0, 30.0), (-16.0, 0.0, 16.0)
_RADIUS_MM = 8.0
_PLACES = tuple(product(_DEPTHS_MM, _SIDES_MM))
_SATURATION = 0.12
"""Of solutions on subject 3's leg: 0.09 (six times as stiff) to 0.14 (half as stiff)."""


@dataclass(frozen=True)
class UnevenMuscle(TissueMechanism):
    """A lump, or a weak spot, somewhere under the indenter; of one size, with no edge.

    A smaller one that is stiffer looks the same, so its size isn't asked for: as much as a disk of
    11 mm radius. Between the places of a lattice it is shared out among them. The force follows the
    excess e as :math:`e / (1 + c e)`, as that of an inclusion does (J. D. Eshelby, Proc. R. Soc. A
    241 (1957) 376), until a full solution says.
    """

    name: ClassVar[str] = "uneven-muscle"
    statement: ClassVar[str] = "a region of the muscle is stiffer or softer than the rest of it"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        factor(
            "factor",
            "on the stiffness there",
            (0.1, 10.0),
            0.7,
            "the calf's muscles differ by up to a factor of two in shear-wave elastography",
        ),
        Parameter(
            "depth",
            "mm",
            (0.0, 36.0),
            Prior(18.0, 9.0, "linear", "anywhere under the indenter"),
            statement="of its middle below the fascia, along the travel",
        ),
        Parameter(
            "side",
            "mm",
            (-20.0, 20.0),
            Prior(0.0, 10.0, "linear", "anywhere under the indenter"),
            statement="of its middle from the line of travel, counter-clockwise positive",
        ),
    )
    next_experiment: ClassVar[str] = "press at a second place of the calf, or map the muscle by shear-wave elastography"
    variant: ClassVar[str] = "uneven"

    @property
    def derivatives(self) -> tuple[str, ...]:
        """Excesses at the lattice's places."""
        return tuple(f"deep.uneven_stiffness.excess{k + 1}" for k in range(len(_PLACES)))

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return stiffer and softer ones, near the fascia, deep, and at the sides."""
        return tuple(
            {"factor": size, "depth": depth, "side": side}
            for size in (0.6, 1.7)
            for depth, side in ((8.0, 0.0), (26.0, 0.0), (14.0, -12.0), (14.0, 12.0))
        )

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the muscle's excess of stiffness at the lattice's places."""
        from legfem.geometry.section import first_crossing
        from legfem.mechanics.terms.nonuniform_stiffness import UnevenStiffness
        from legfem.meshing.section import first_touch

        travel, radius = leg.indenter.direction, leg.indenter.radius
        centre = np.asarray(first_touch(leg.section.skin, radius, leg.indenter.aim, travel))
        fascia = first_crossing(leg.section.polygon("fascia").exterior, centre, travel)
        across = np.array([-travel[1], travel[0]])
        points = [centre + (fascia + depth) * travel + side * across for depth, side in _PLACES]
        places = tuple((float(x), float(y)) for x, y in points)
        return [UnevenStiffness("deep", leg.tissues.deep, places, _RADIUS_MM)]

    def shares(self, values: Values) -> FloatArray:
        """Return what the derivative by every place's excess is multiplied by."""
        excess = values["factor"] - 1
        return excess / (1 + _SATURATION * excess) * _weights(values["depth"], values["side"])

    def solution(self, values: Values) -> Solution:
        """Return the model with that excess."""
        excess = (values["factor"] - 1) * _weights(values["depth"], values["side"])
        return Solution(self.variant, dict(zip(self.derivatives, map(float, excess), strict=True)))


def _weights(depth: float, side: float) -> FloatArray:
    """Return the shares of the lattice's places in one between them; their sum is one."""
    return np.outer(_near(depth, _DEPTHS_MM), _near(side, _SIDES_MM)).ravel()


def _near(at: float, nodes: Sequence[float]) -> FloatArray:
    away = (at - np.array(nodes)) / (0.5 * (nodes[1] - nodes[0]))
    each = np.exp(-0.5 * (away**2 - np.min(away**2)))
    return np.asarray(each / each.sum())

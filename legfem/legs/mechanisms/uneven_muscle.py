"""A region of the muscle is stiffer or softer than the rest."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar, Protocol

import numpy as np

from legfem.common.units import FloatArray
from legfem.geometry.indenter import Indenter, first_touch
from legfem.geometry.section import LegSection, across, first_crossing
from legfem.inverse.mechanism import IndentedLeg, Solution, TissueMechanism, Values, factor
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter, Prior

_DEPTHS_MM, _SIDES_MM = (6.0, 18.0, 30.0), (-16.0, 0.0, 16.0)
_RADII_MM = (5.5, 11.0)
"""Of a lump."""
_LUMPS = tuple(product(_RADII_MM, _DEPTHS_MM, _SIDES_MM))
_SHARED = 0.4
"""Of the distance between places: how far from one its response is shared with the next."""
_SATURATION = 0.5
"""Of solutions on a leg of 0.8 kPa: right within 7 % up to three times as stiff, and within 11 % down to a third."""
_HARD = 10.0
"""Factor at which it is solved, too: from there on a lump is as good as rigid."""


class SectionUnderIndenter(Protocol):
    """A section, and what it is pressed by."""

    @property
    def section(self) -> LegSection:
        """Across the leg."""
        ...

    @property
    def indenter(self) -> Indenter:
        """Its size, aim and direction."""
        ...


def place_in_section(leg: SectionUnderIndenter, depth: float, side: float) -> tuple[float, float]:
    """Return a place in the section's coordinates, mm.

    Parameters
    ----------
    leg
        The leg.
    depth
        Below the fascia along the travel (mm).
    side
        To the left of the line of travel (mm).
    """
    travel, radius = leg.indenter.direction, leg.indenter.radius
    centre = np.asarray(first_touch(leg.section.skin, radius, leg.indenter.aim, travel))
    fascia = first_crossing(leg.section.polygon("fascia").exterior, centre, travel)
    x, y = centre + (fascia + depth) * travel + side * across(travel)
    return float(x), float(y)


@dataclass(frozen=True)
class UnevenMuscle(TissueMechanism):
    r"""A lump, or a weak spot, somewhere under the indenter.

    A smaller one that is stiffer changes the force likewise, but moves the tissue about it less, so that the rest of
    the muscle is told apart from it by other channels. Between places and radii of a lattice its response is shared
    out among them; its own solution is of one lump. The force follows the excess e as :math:`g = \ln(1 + c e) / c`,
    less and less as that of an inclusion does (J. D. Eshelby, Proc. R. Soc. A 241 (1957) 376); what that misses of a
    solution with a hard lump at each place counts with the square of g over its own there.
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
        Parameter(
            "radius",
            "mm",
            (_RADII_MM[0], _RADII_MM[-1]),
            Prior(8.0, 2.5, "linear", "from a tendon's to a muscle's own size"),
            statement="of it, taken as a disk",
        ),
    )
    would_be: ClassVar[str] = "a region of the muscle of {} times the stiffness of the rest"
    next_experiment: ClassVar[str] = "press at a second place of the calf, or map the muscle by shear-wave elastography"
    expected: ClassVar[float] = 3.0
    """Aponeuroses and tendons run through every calf, and vessels: what isn't known is whether they matter."""
    variant: ClassVar[str] = "uneven"

    @property
    def derivatives(self) -> tuple[str, ...]:
        """Excesses at the lattice's places."""
        return tuple(f"deep.uneven_stiffness.excess{k + 1}" for k in range(len(_LUMPS)))

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return stiffer and softer ones, near the fascia, deep, and at the sides."""
        return tuple(
            {"factor": size, "depth": depth, "side": side, "radius": 8.0}
            for size in (0.6, 1.7)
            for depth, side in ((8.0, 0.0), (26.0, 0.0), (14.0, -12.0), (14.0, 12.0))
        )

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the muscle's excess of stiffness at the lattice's places, and at one that solutions choose."""
        from legfem.mechanics.terms.nonuniform_stiffness import StiffLump, UnevenStiffness

        muscle, travel = leg.tissues.deep, leg.indenter.direction
        points = tuple(place_in_section(leg, depth, side) for _, depth, side in _LUMPS)
        radii = tuple(radius for radius, _, _ in _LUMPS)
        origin = place_in_section(leg, 0.0, 0.0)
        return [
            UnevenStiffness("deep", muscle, points, radii),
            StiffLump("deep", muscle, origin, (float(travel[0]), float(travel[1])), radius=_RADII_MM[0]),
        ]

    @property
    def nodes(self) -> tuple[Values, ...]:
        """A hard lump at each of the lattice's places, of each radius."""
        return tuple(
            {"factor": _HARD, "depth": depth, "side": side, "radius": radius} for radius, depth, side in _LUMPS
        )

    def shares(self, values: Values) -> FloatArray:
        """Return what the derivative by every place's excess is multiplied by, and what a hard lump's rest there."""
        at, weights = _saturating(values["factor"]), _weights(values)
        return np.concatenate([at * weights, (max(at, 0.0) / _saturating(_HARD)) ** 2 * weights])

    def solution(self, values: Values) -> Solution:
        """Return the model with one lump."""
        given = {
            "excess": values["factor"] - 1,
            "depth": values["depth"],
            "side": values["side"],
            "radius": values["radius"],
        }
        return Solution(self.variant, {f"deep.stiff_lump.{name}": float(value) for name, value in given.items()})


def _saturating(factor: float) -> float:
    return float(np.log1p(_SATURATION * (factor - 1)) / _SATURATION)


def _weights(values: Values) -> FloatArray:
    """Return the shares of the lattice's lumps in one between them; their sum is one."""
    small, large = np.log(_RADII_MM)
    larger = float(np.clip((np.log(values["radius"]) - small) / (large - small), 0.0, 1.0))
    of_places = np.outer(_near(values["depth"], _DEPTHS_MM), _near(values["side"], _SIDES_MM)).ravel()
    return np.outer([1 - larger, larger], of_places).ravel()


def _near(at: float, nodes: Sequence[float]) -> FloatArray:
    away = (at - np.array(nodes)) / (_SHARED * (nodes[1] - nodes[0]))
    each = np.exp(-0.5 * (away**2 - np.min(away**2)))
    return np.asarray(each / each.sum())

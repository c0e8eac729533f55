"""The fat isn't as stiff as assumed, stiffens with strain, or slides along the fascia."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from legfem.common.units import kpa_to_mpa
from legfem.inverse.mechanism import IndentedLeg, Solution, TissueMechanism, Values, factor, strength
from legfem.inverse.parameter import Parameter


@dataclass(frozen=True)
class SuperficialStiffness(TissueMechanism):
    """The fat's stiffness, over the one given."""

    name: ClassVar[str] = "superficial-stiffness"
    statement: ClassVar[str] = "the superficial tissue (fat) is stiffer or softer than assumed"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        factor("factor", "on C10", (0.1, 9.0), 0.9, "reported stiffness of fat differs tenfold"),
    )
    would_be: ClassVar[str] = "fat of {} times the assumed stiffness"
    next_experiment: ClassVar[str] = (
        "press gently with a small tip (2 mm deep), or image the fat's thickness under load"
    )
    measured_sd: ClassVar[float | None] = 0.25
    """An estimate."""
    strengths: ClassVar[tuple[float, ...]] = (0.4, 1.7, 3.5, 8.0)

    def solution(self, values: Values) -> Solution:
        """Return the model with that parameter scaled."""
        return Solution(scaled={"superficial.C10": values["factor"]})


@dataclass(frozen=True)
class FatStiffening(TissueMechanism):
    """A second and a third coefficient of the fat's energy, where the model has one."""

    name: ClassVar[str] = "superficial-stiffening"
    statement: ClassVar[str] = "the superficial tissue (fat) stiffens as it is squeezed"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("coefficient", "kPa", "of the fat's energy's third power", 3.0, (0.0, 60.0)),
    )
    next_experiment: ClassVar[str] = "image the fat's thickness under load, at several depths"
    strengths: ClassVar[tuple[float, ...]] = (1.0, 6.0, 25.0)

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the fat with more coefficients of its energy."""
        from legfem.mechanics.materials import Yeoh
        from legfem.mechanics.terms import Tissue

        return [Tissue("superficial", Yeoh.of(leg.tissues.superficial))]

    def solution(self, values: Values) -> Solution:
        """Return the law with its third coefficient."""
        return Solution(parameters={"superficial.C30": kpa_to_mpa(values["coefficient"])})


_FREE = 0.999
"""Of the lowest elements' resistance to shear along the fascia what a free interface is without."""

_POINTS = 1000
"""Of the fascia's contour."""


@dataclass(frozen=True)
class FatSliding(TissueMechanism):
    """Sliding of the fat over the muscle between none (grown together) and free.

    The force is taken in proportion between the two ends, as that of a skin that slips along the cylinder.
    """

    name: ClassVar[str] = "fat-sliding"
    statement: ClassVar[str] = "the fat slides along the fascia: the two are not grown together"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("sliding", "-", "share of the way from grown together to free", 0.6, (0.0, 1.0)),
    )
    would_be: ClassVar[str] = "fat that slides along the fascia, {} of the way to free"
    next_experiment: ClassVar[str] = "film fat and fascia with ultrasound beside the cylinder while it presses"
    measured_sd: ClassVar[float | None] = 0.2
    """An estimate: speckle is followed to some 0.3 mm beside ways of one or two."""
    variant: ClassVar[str] = "fat slides"
    strengths: ClassVar[tuple[float, ...]] = (1.0,)

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return what the fat's lowest elements lose of their resistance to shear along the fascia."""
        from legfem.geometry.section import smooth_closed_curve
        from legfem.mechanics.terms import Sliding

        # What slides far along a polygon meets its corners.
        smooth = smooth_closed_curve(leg.section.fascia)(np.linspace(0.0, 1.0, _POINTS, endpoint=False))
        return [Sliding(leg.tissues.superficial, smooth)]

    def solution(self, values: Values) -> Solution:
        """Return the model whose fat slides freely; nothing between is solved."""
        return Solution(self.variant, {"superficial.sliding.freedom": _FREE})

    def tabulated(self, values: Values) -> float:
        """Return free sliding."""
        return self.strengths[0]

    def share(self, values: Values) -> float:
        """Return the share of the way there."""
        return values["sliding"]

"""The fat slides along the fascia."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from legfem.inverse.mechanism import IndentedLeg, Solution, TissueMechanism, Values, strength
from legfem.inverse.parameter import Parameter

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
        from legfem.geometry.curve import smooth_closed_curve
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

r"""Images of the section that lie beside where they are said to, and what that does to what is read in them.

An image is laid into the section by hand, or by its outline. What it shows at :math:`X` is truly at

.. math:: x = c + s + R\,(X - c)

with a shift :math:`s` and a turn :math:`R` about its middle :math:`c`, and a displacement there is shown turned back,
:math:`R^T u(x)`. The state is read as images show it that are laid to either side of the stated one, by `STEP_MM` in
both directions and by `STEP_DEG`: half the difference is what such a step does, and exact where the field is straight
or a parabola between the two. Across the outline of a tissue, where the gradient jumps, a difference misses half of
what the gradient at the point does.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from types import MappingProxyType

import numpy as np

from legfem.common.units import FloatArray

STEP_MM, STEP_DEG = 1.0, 1.5


@dataclass(frozen=True)
class Laid:
    """How an image is laid beside where it is said to lie.

    Parameters
    ----------
    shift
        mm.
    turn_deg
        About its middle, counter-clockwise, degrees.
    """

    shift: tuple[float, float] = (0.0, 0.0)
    turn_deg: float = 0.0

    @property
    def other_side(self) -> "Laid":
        """As far to the other side."""
        return Laid((-self.shift[0], -self.shift[1]), -self.turn_deg)

    @cached_property
    def _turn(self) -> FloatArray:
        angle = math.radians(self.turn_deg)
        return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])

    def truly(self, points: FloatArray, middle: FloatArray) -> FloatArray:
        """Return where points (..., 2) of an image with a middle (2,) truly are, mm."""
        return np.asarray(middle + self.shift + (points - middle) @ self._turn.T)

    def turned(self, way: FloatArray) -> FloatArray:
        """Return where a direction (2,) of the image truly points to."""
        return np.asarray(self._turn @ way)

    def shown(self, vectors: FloatArray) -> FloatArray:
        """Return vectors (..., 2) of the section as the image shows them."""
        return np.asarray(vectors @ self._turn)


AS_STATED = Laid()
WAYS: Mapping[str, Laid] = MappingProxyType(
    {"shift in x": Laid((STEP_MM, 0.0)), "shift in y": Laid((0.0, STEP_MM)), "turn": Laid(turn_deg=STEP_DEG)}
)
"""Ways in which an image may lie elsewhere, by a step each."""
IMAGES = (AS_STATED, *(side for image in WAYS.values() for side in (image, image.other_side)))
"""An image as stated, then to both sides in each of the ways."""


@cache
def laid_course(course: str, way: str) -> str:
    """Return the name of what a step in one of the `WAYS` does to a channel's course."""
    return f"{course}:{way}"

r"""A block in simple shear between two plates that keep their distance.

.. math:: F = I + \gamma\, e_1 \otimes e_2, \quad \tau = 2 w(\gamma^2)\, \gamma,

with the law's :math:`w = \partial U / \partial \bar I_1`: no volume changes, so that compressibility does nothing
(R. W. Ogden, Non-linear Elastic Deformations (1984), section 2.2). A neo-Hookean block has
:math:`\tau = 2 C_{10} \gamma`.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from legfem.common.input_files import FileTable, Positive
from legfem.experiments.bodies import HomogeneousBody
from legfem.specimens.kind import HomogeneousKind


class ShearEntry(FileTable):
    """``[simple_shear]``: a block whose faces stick to two plates, one of which moves along itself."""

    height_mm: Positive | None = None
    """Distance between the plates."""
    area_mm2: Positive | None = None
    """Area of a plate that sticks."""


@dataclass(frozen=True)
class ShearedBlock(HomogeneousBody):
    """A block so wide that its free sides don't count, ``length`` between the plates."""

    free: ClassVar = ()
    component: ClassVar = (0, 1)

    def gradient(self, strain: Any, free: Any) -> Any:
        """Return the amount of shear of the first axis by the second."""
        return np.eye(3) + strain[..., None, None] * np.eye(3, k=1) * [[1], [0], [0]]

    def free_stretch(self, strain: Any) -> Any:
        """Return none: every axis is held."""
        return np.ones_like(strain)


class SimpleShearKind(HomogeneousKind[ShearEntry, ShearedBlock]):
    """The block."""

    table: ClassVar = "simple_shear"
    words: ClassVar = "a block in simple shear"
    done: ClassVar = "a block that sticks to two plates, sheared by one of them"
    own: ClassVar = {"height_mm": "length", "area_mm2": "area"}
    cube: ClassVar = {"height_mm": 10.0, "area_mm2": 100.0}
    no_slip: ClassVar = "the plates are said to hold the block"
    strain: ClassVar = "amount of shear"

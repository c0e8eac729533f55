"""Compression classes of stockings.

The pressure at the ankle of the classes of RAL-GZ 387/1 (Medical Compression Hosiery, Quality
Assurance, 2008), in mmHg. Upwards the pressure falls; below the knee the standard allows at most
70 % of the ankle's.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from legfem.common.errors import InputError
from legfem.common.units import mmhg_to_mpa
from legfem.geometry.leg_shape import LegShape
from legfem.stocking.laplace import Stocking, stocking_load

CALF_SHARE = 0.7
"""Of the pressure at the ankle, at the calf."""


class CompressionClass(StrEnum):
    """A class of RAL-GZ 387/1."""

    LIGHT = "1"
    MODERATE = "2"
    STRONG = "3"
    VERY_STRONG = "4"


ANKLE_MMHG = {
    CompressionClass.LIGHT: (18.0, 21.0),
    CompressionClass.MODERATE: (23.0, 32.0),
    CompressionClass.STRONG: (34.0, 46.0),
    # 49 mmHg and more: its lower bound is taken for both.
    CompressionClass.VERY_STRONG: (49.0, 49.0),
}


@dataclass(frozen=True)
class ClassFit:
    """How a stocking of a class is chosen for a leg.

    Parameters
    ----------
    compression_class : CompressionClass
        Whose middle pressure is meant.
    stiffness : float
        Of the fabric (N/mm per unit of strain).
    share : float
        Of the ankle's pressure that is meant at the calf.
    """

    compression_class: CompressionClass
    stiffness: float = 0.3
    share: float = CALF_SHARE

    @property
    def pressure(self) -> float:
        """Mean pressure at the calf (MPa)."""
        return self.share * mmhg_to_mpa(float(np.mean(ANKLE_MMHG[self.compression_class])))


def fitted_stocking(shape: LegShape, fit: ClassFit) -> Stocking:
    r"""Return the stocking whose mean pressure on a bare leg is the class's at every height.

    At a height with the perimeter L that the fabric spans, the mean pressure is
    :math:`2 \pi T / L`.

    Raises
    ------
    InputError
        If the fabric would have to be stretched more than threefold.
    """
    probe = Stocking(1.0, shape.levels[:1], np.array([1.0]))
    perimeter = stocking_load(shape, probe).perimeter
    strain = fit.pressure * perimeter / (2 * np.pi) / fit.stiffness
    if strain.max() > 2:
        raise InputError(
            "stocking",
            "stiffness_N_per_mm",
            f"at {fit.stiffness:g} N/mm the fabric is stretched by {100 * strain.max():.0f} %",
            "give a stiffer fabric, in N/mm of tension per unit of strain",
        )
    return Stocking(fit.stiffness, shape.levels, perimeter / (1 + strain))

"""Whether what a cup recorded can be a suction, in the units that are said."""

from __future__ import annotations

import math

import numpy as np

from legfem.common.doubts import Doubt
from legfem.common.errors import InputError
from legfem.common.units import mpa_to_kpa
from legfem.data import Recording

ATMOSPHERE_KPA = 101.325
_SLACK = 1.05
"""Of a gauge's error and of high pressure over a plain."""
_USUAL_KPA = (1.0, 80.0)
"""Cutometers and aspiration devices on skin and organs draw with 2 to 60 kPa."""
_HIGHEST = 2.0
"""Of a dome over its opening's radius: a half ball has 1."""


def suction_doubts(recording: Recording, opening: float) -> list[Doubt]:
    """Return what is unlikely in a recording whose force is a suction on an opening (mm2).

    Raises
    ------
    InputError
        For a suction of more than the atmosphere, and a dome that no skin makes.
    """
    source = f"{recording.source or recording.trial}"
    peak = mpa_to_kpa(float(np.abs(recording.force).max()) / opening)
    if peak > _SLACK * ATMOSPHERE_KPA:
        raise InputError(
            source,
            "pressure",
            f"a suction of {peak:.4g} kPa is more than the atmosphere has",
            f"check the unit: as mbar it is {0.1 * peak:.3g} kPa, as mmHg {0.1333 * peak:.3g} kPa",
        )
    radius, height = math.sqrt(opening / math.pi), float(np.ptp(recording.displacement))
    if height > _HIGHEST * radius:
        raise InputError(
            source,
            "displacement",
            f"a dome of {height:.3g} mm over an opening of {2 * radius:.3g} mm",
            "check its unit, and opening_mm",
        )
    if not _USUAL_KPA[0] <= peak <= _USUAL_KPA[1]:
        return [
            Doubt(
                source,
                "pressure",
                f"a suction of {peak:.3g} kPa is unusual (it is {_USUAL_KPA[0]:g} to {_USUAL_KPA[1]:g} kPa)",
                "check its unit",
            )
        ]
    return []

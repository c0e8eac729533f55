"""The least and the most force with which a leg pushes back, without solving for it.

Envelopes of plane-strain solutions: ``python -m studies.expected_force`` solves random legs (girth
250 to 450 mm, fat of 1.2 to 25 mm and 0.5 to 20 kPa, fascia of 10 kPa to 10 MPa, cylinders of 18 to
52 mm) with the softest and the stiffest deep tissue there is, and fits planes in the logarithms
beyond which none of them lies by more than 5 %. The coefficients here are a first run's.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from legfem.common.units import FloatArray
from legfem.geometry.section import depth_to_bone, fat_thickness, girth

if TYPE_CHECKING:
    from legfem.geometry.section import LegSection
    from legfem.subjects.subject import Indenter, Subject

SOFTEST_KPA, STIFFEST_KPA, STIFFEST_C20_KPA = 0.05, 10.0, 40.0
"""C10 of the two deep tissues, and C20 of the stiffer."""
_LEAST = (-4.452, 0.145, 0.139, 0.417, -0.994, 0.327, 1.195, 1.159, 0.002)
_MOST = (-0.623, 0.185, 0.026, -0.33, 0.519, 0.103, 0.853, 2.98, -0.481)


def force_range(subject: Subject, displacement: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the least and the most force (N) at displacements (mm) after first touch.

    Of a fat and a fascia as the subject's folder states them.
    """
    fat, fascia = (1e3 * (subject.tissues[name].C10 or 0.0) for name in ("superficial", "fascia"))
    about = features(subject.section, subject.indenter, fat, fascia, subject.tissues["superficial"].D1, displacement)
    length = subject.indenter.length
    return length * np.exp(about @ _LEAST), length * np.exp(about @ _MOST)


def features(
    section: LegSection, indenter: Indenter, fat_kpa: float, fascia_kpa: float, fat_d1: float, displacement: FloatArray
) -> FloatArray:
    """Return what the logarithm of the force per length (N/mm) is linear in, (n, 9)."""
    aim, direction = indenter.aim, indenter.direction
    fat = max(fat_thickness(section, aim, direction), 0.5)
    depth = np.asarray(displacement, dtype=np.float64)
    share = np.minimum(depth / depth_to_bone(section, aim, direction), 1.0)
    same = [
        1.0,
        math.log(fat_kpa / 2.0),
        math.log(fascia_kpa * section.fascia_thickness / 60.0),
        math.log(fat / 6.0),
        math.log(girth(section) / 360.0),
        math.log(indenter.radius / 15.0),
    ]
    return np.column_stack(
        [
            np.tile(same, (len(depth), 1)),
            np.log(depth / 20.0),
            -np.log(1 - 0.9 * share),
            np.full(len(depth), math.log(fat_d1 / 22.5)),
        ]
    )

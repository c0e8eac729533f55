"""A lab's errors drawn all together, wider than the diagnosis assumes."""

from __future__ import annotations

import numpy as np

from studies.lab.recording import LabErrors
from studies.lab.stated import AIM_MM, DIRECTION_DEG, FACTOR, Misstated

GAINS, CONTOURS_MM, AIR_MM = (0.003, 0.03), (0.3, 1.0), 4.0


def drawn_errors(generator: np.random.Generator) -> LabErrors:
    """Return errors of a lab's recordings."""
    return LabErrors(
        gain_sd=float(np.exp(generator.uniform(*np.log(GAINS)))),
        air=AIR_MM,
        heavy=bool(generator.random() < 0.5),
        same_travel=bool(generator.random() < 0.5),
    )


def drawn_misstatement(generator: np.random.Generator) -> Misstated:
    """Return errors of what a lab states of a leg."""
    contour = float(generator.uniform(*CONTOURS_MM))
    return Misstated(contour, AIM_MM, DIRECTION_DEG, FACTOR)

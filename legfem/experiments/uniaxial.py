r"""A bar or cylinder in homogeneous uniaxial tension or compression.

Its ends don't keep it from growing or shrinking sideways. An incompressible neo-Hookean bar, pulled along its fibres,
has

.. math:: P = \mu_T (\lambda - \lambda^{-2}) + \tfrac12 (E_L - 3 \mu_T) (\lambda^2 - 1) \lambda,

and across them, at small strain, Young's modulus :math:`4 \mu_T E_L / (E_L + \mu_T)`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from legfem.experiments.bodies import HomogeneousBody


@dataclass(frozen=True)
class UniaxialSpecimen(HomogeneousBody):
    """A straight specimen, ``length`` between the grips or plates, ``area`` that of its cross-section.

    Parameters
    ----------
    pulled : {"tension", "compression"}
        Displacement and force are positive that way.
    """

    pulled: Literal["tension", "compression"] = "compression"

    free: ClassVar[tuple[int, ...]] = (1, 2)
    component: ClassVar[tuple[int, int]] = (0, 0)

    @property
    def sign(self) -> float:
        """Of the strain along the bar."""
        return 1.0 if self.pulled == "tension" else -1.0

    def gradient(self, strain: Any, free: Any) -> Any:
        """Return a stretch along the first axis, and free ones across."""
        return np.stack([1 + strain, *free], axis=-1)[..., None] * np.eye(3)

    def free_stretch(self, strain: Any) -> Any:
        """Return the stretch across of an incompressible bar."""
        return (1 + strain) ** -0.5

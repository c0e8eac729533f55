r"""What is inside the veins, standing and lying, beside what the stocking makes of the tissue.

Standing still, the blood's column from the heart presses from inside:

.. math:: p_\text{in} = \rho g\, (z_\text{heart} - z),

and a vein bears the difference to the tissue's pressure, :math:`p_\text{in} - p`: it is narrowed
from outside where that is negative. The tissue's own weight is left out, as in the model.
"""

from __future__ import annotations

from dataclasses import dataclass

BLOOD_KG_PER_M3 = 1060.0
GRAVITY_M_PER_S2 = 9.80665
_MPA_PER_MM = BLOOD_KG_PER_M3 * GRAVITY_M_PER_S2 * 1e-9
"""Of height."""


@dataclass(frozen=True)
class Posture:
    """Where the heart is, and what a lying person's veins hold.

    Parameters
    ----------
    heart : float
        Height of the heart above the scan's z = 0 when standing (mm).
    lying : float, optional
        Pressure in the leg's veins when lying (MPa).
    """

    heart: float
    lying: float | None = None

    def inside(self, height: float) -> dict[str, float]:
        """Return the pressure in a vein at a height z (mm) by posture, MPa."""
        standing = {"standing": _MPA_PER_MM * (self.heart - height)}
        return standing if self.lying is None else {**standing, "lying": self.lying}

r"""What makers ask of a leg in its stocking; on a leg by tape, from its girths alone.

Whatever the shape of a section, the pressure round it sums to :math:`2 \pi T` by Laplace's law, and a tape spans
hollows as the fabric does. So the mean pressure follows from girth and fabric alone, and round rings of the girth have
it; what presses at one place, and inside the leg, hangs on the shape and isn't told.

The leg gives way. In 3D it hardly does, as its tissue keeps its volume (0.1 to 0.3 % of the girth on the six legs that
come with legfem), but blood and fluid leave a living one: after hours in 20 to 30 mmHg the calf measured
5.2 ± 7.0 mm less (C. L. Buhs et al., J. Vasc. Surg. 30 (1999) 830), errors of the tape included. So a share
:math:`c p` is taken off the girth, with :math:`p` the pressure on the bare leg. An error of the girth by a share
changes the pressure by that over the fabric's strain.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from legfem.common.units import FloatArray, mmhg_to_mpa, mpa_to_kpa
from legfem.geometry.leg_shape import HULL, SKIN, LegShape, perimeter
from legfem.inverse.answer import Answer
from legfem.inverse.fit import Fit, KindDetails, answer_of
from legfem.stockings.fabric import StockingLoad, stocking_load
from legfem.stockings.leg import StockingLeg
from legfem.stockings.levels import FabricFor, LevelPressure, PressureAlong, fabrics_for_classes, pressures_at_levels

GIVES, GIVES_SD = 0.014 / mmhg_to_mpa(25.0), 0.010 / mmhg_to_mpa(25.0)
"""Share of the girth that a pressure takes off (1/MPa), and its standard deviation between people: what the tape's own
errors leave of 7 mm."""


def rings(levels: FloatArray, girths: FloatArray) -> LegShape:
    """Return round rings of girths (n,) at levels (n,), mm; their hull and bone count for nothing."""
    angles = np.linspace(0, 2 * np.pi, 181)[:-1]
    ring = girths[:, None, None] * np.column_stack([np.cos(angles), np.sin(angles)]) / (360 * np.sin(np.pi / 180))
    return LegShape(levels, {SKIN: ring, HULL: 0.8 * ring, "bone": 0.3 * ring})


@dataclass(frozen=True, eq=False)
class TapeDetails(KindDetails):
    """A leg by tape in its stocking; what is told of its levels is told of one that was solved for, too.

    Parameters
    ----------
    leg
        What was given.
    """

    leg: StockingLeg

    @property
    def load(self) -> StockingLoad:
        """Load of the fabric on the leg that gives way: on rings of the girths less what the pressure takes off."""
        bare, fabric = self.leg.bare, self.leg.stocking
        left = 1 - GIVES * stocking_load(bare, fabric).pressure.mean(axis=1)
        return stocking_load(rings(bare.levels, perimeter(bare) * left), fabric)

    @property
    def pressure_along(self) -> PressureAlong:
        """Pressure of the stocking by height, with the errors of the girths and of how far the leg gives way."""
        load, on_bare = self.load, stocking_load(self.leg.bare, self.leg.stocking)
        along = PressureAlong.of(self.leg.bare, load, on_bare, self.leg.accuracy)
        of_girth = np.hypot(self.leg.girth_sd or 0.0, GIVES_SD * load.pressure.mean(axis=1))
        # A slack fabric presses with nothing.
        return replace(along, sd=np.hypot(along.sd, along.mean * of_girth / np.maximum(on_bare.strain, 0.01)))

    @property
    def tension_sd(self) -> float:
        """Relative standard deviation of the fabric's tension."""
        return self.leg.accuracy.tension_sd

    @property
    def at_levels(self) -> list[LevelPressure]:
        """Pressure at every level of makers that the leg has, in the part that was modelled."""
        return list(pressures_at_levels(self.pressure_along, self.leg.makers, self.leg.bare))

    @property
    def fabrics(self) -> list[FabricFor]:
        """Fabric that meets each class on this leg."""
        return list(fabrics_for_classes(self.pressure_along, self.load, self.leg.makers, self.leg.bare))

    @property
    def at_ankle(self) -> dict[str, Any] | None:
        """Pressure at B (mmHg) beside the class; None where B isn't known, or no real fabric is worn."""
        one = next((one for one in self.at_levels if one.level == "B"), None)
        if one is None or self.leg.makers.assumed_fabric:
            return None
        known = {"mean": one.mean_pressure_mmHg, "ci95": one.ci95_mmHg, "limits": one.limits_mmHg}
        return {**known, "verdict": one.verdict, "class": str(self.leg.makers.intended_class)}

    def answer(self, fit: Any) -> Answer:
        """Return what the fit says: the pressure at B, and from the least to the greatest of the levels, mmHg."""
        mean = self.pressure_along.mean
        return answer_of(fit, True, ankle=self.at_ankle, spread=(float(mean.min()), float(mean.max())))

    def members(self, fit: Any) -> dict[str, Any]:
        """Return the fabric, pressures at makers' levels, and which fabric meets each class."""
        stocking, load, shape = self.leg.stocking, self.load, self.leg.bare
        return {
            "stocking": {
                "stiffness_N_per_mm": stocking.stiffness,
                "bending_length_mm": stocking.bending_length,
                "unstretched": {"levels_mm": stocking.levels.tolist(), "perimeters_mm": stocking.unstretched.tolist()},
                "levels_mm": shape.levels.tolist(),
                "perimeter_mm": load.perimeter.tolist(),
                "strain": load.strain.tolist(),
                "tension_N_per_mm": load.tension.tolist(),
                "mean_pressure_kPa": mpa_to_kpa(load.pressure.mean(axis=1)).tolist(),
                "share_of_skin_without_pressure": load.unloaded_skin.tolist(),
            },
            "makers_levels": [{**vars(one), "verdict": one.verdict} for one in self.at_levels],
            "fabric_for_classes": [vars(one) for one in self.fabrics],
        }


type TapeFit = Fit[TapeDetails]

"""The contours of a leg in its stocking near a state: how far off they are, and their slopes.

Slopes are those of the equilibrium: what changes the shape changes the pressure too.
"""

from __future__ import annotations

from functools import cached_property

from legfem.common.units import FloatArray
from legfem.stocking.misfit import ContourMisfit
from legfem.stocking.worn import Feedback, Worn, WornLeg, slope_step


class LinearisedContours:
    """Distances (mm) of a worn leg from its scan, and their derivatives, (n,) each.

    Parameters
    ----------
    leg
        The leg.
    misfit
        The scanned contours.
    worn
        The equilibrium that was found last.
    """

    def __init__(self, leg: WornLeg, misfit: ContourMisfit, worn: Worn) -> None:
        self._model, self._misfit, self._worn = leg.model, misfit, worn
        self._feedback = Feedback(leg, worn)
        self._rates: dict[str, FloatArray] = {}

    @cached_property
    def distances(self) -> FloatArray:
        """How far the leg lies outside its scan."""
        return self._misfit.distances(self._worn.shape)

    def by_parameter(self, name: str) -> FloatArray:
        """Return the slope by a parameter of the model by which the state was differentiated."""
        return self._slope(self._rate(name))

    def pressure_by_parameter(self, name: str) -> FloatArray:
        """Return that of the stocking's pressure at the skin's points, (n_levels, n_points)."""
        return self._feedback.pressure_slope(self._rate(name))

    def _rate(self, name: str) -> FloatArray:
        if name not in self._rates:
            self._rates[name] = self._feedback.to_rate(self._worn.state.sensitivities[name])
        return self._rates[name]

    def _slope(self, rate: FloatArray) -> FloatArray:
        step = slope_step(self._model, rate)
        ahead = self._model.deformed_shape(self._worn.state.unknown + step * rate)
        return (self._misfit.distances(ahead) - self.distances) / step

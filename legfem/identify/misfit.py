"""The difference between a law's curve and the measured one, and what it costs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from legfem.common.units import FloatArray, kpa_to_mpa, mpa_to_kpa
from legfem.correction.choice import Correction, correction_factor
from legfem.data import LoadingCurve
from legfem.identify.error_sources import covariances_of_modes
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.comparison import Comparison, Covariances, Prediction, total_of
from legfem.inverse.errors import numerical_covariance
from legfem.inverse.instrument import INSTRUMENT, Reading
from legfem.inverse.outcome import Outcome
from legfem.inverse.settings import Weighting

_STEP = 1e-4


@dataclass(frozen=True, eq=False)
class Misfit(Comparison):
    """How far forces are from the measured curve.

    Parameters
    ----------
    measured : LoadingCurve
        Mean of the trials, with its covariance.
    weighting : {"paper", "covariance"}
        What `objective` sums.
    correction : Correction, optional
        Applied to every force.
    beyond : float
        How far the model's grid goes on after the measured one (mm), for contact that began before
        the recording's zero.
    reads : bool
        Whether the instrument's gain, zero or offset of contact count.
    about : tuple, optional
        Values and force (n,), N, of a solve near the recordings, about which the correction's error
        counts in the weights too, as it must where what was known beforehand is weighed against the
        recordings. As a share of recorded forces it would draw the model to one side (Peelle's
        puzzle).
    """

    measured: LoadingCurve
    weighting: Weighting
    correction: Correction | None = None
    beyond: float = 0.0
    reads: bool = False
    about: tuple[Mapping[str, float], FloatArray] | None = None

    @property
    def displacement(self) -> FloatArray:
        """The measured curve's grid, mm; (n,)."""
        return self.measured.displacement

    @property
    def measured_force(self) -> FloatArray:
        """Of the measured curve (n,), N."""
        return self.measured.force

    @property
    def if_deeper(self) -> FloatArray:
        """Change of the measured forces (n,) per relative change of the displacements, N."""
        return -self.displacement * np.gradient(self.measured.force, self.displacement)

    @property
    def reach(self) -> str:
        """The deepest point of the grid."""
        return f"{self.grid[-1]:g} mm"

    def reached_by(self, outcome: Outcome) -> bool:
        """Return whether a solve came to the grid's end; short of it says nothing of the rest."""
        return outcome.curve.depth >= self.grid[-1] - 1e-9

    @cached_property
    def grid(self) -> FloatArray:
        """The model's grid, mm; (m,)."""
        own = self.displacement
        step = own[1] - own[0]
        further = own[-1] + step * np.arange(1, int(np.ceil(self.beyond / step - 1e-9)) + 1)
        return np.concatenate([own, further])

    @cached_property
    def covariance(self) -> FloatArray:
        """Of measured less predicted force at the truth; (n, n), N2.

        Without the correction's, unless it counts in the weights.
        """
        if self.about is None:
            return self.measured.covariance + self.numerical_covariance
        return total_of(self._covariances(*self.about))

    @cached_property
    def numerical_covariance(self) -> FloatArray:
        """Of the numerical model's errors; (n, n), N2."""
        return numerical_covariance(self.displacement, self.measured.force, power=1.0)

    def covariance_at(self, values: Mapping[str, float]) -> FloatArray:
        """Return the covariance with the correction's at values; (n, n), N2."""
        return total_of(self.covariances_at(values))

    def covariances_at(self, values: Mapping[str, float]) -> Covariances:
        """Return the parts of the covariance, with the correction's at the model's values."""
        return self._covariances(values, self.measured.force)

    def _covariances(self, values: Mapping[str, float], force: FloatArray) -> Covariances:
        return {
            "recordings": self.measured.covariance,
            "model": self.numerical_covariance,
            **covariances_of_modes(self.modes_of_correction(values, force)),
        }

    def modes_of_correction(self, values: Mapping[str, float], force: FloatArray) -> dict[str, FloatArray]:
        """Return the correction's errors (n,), N, of a force (n,) at the model's values."""
        if self.correction is None:
            return {}
        relative = self.correction.relative_errors(self.displacement, *_stiffness(values))
        return {name: error * force for name, error in relative.items()}

    def weighted(self, values: FloatArray) -> FloatArray:
        """Return values (n, ...) scaled so that `objective` is their sum of squares."""
        return values if self.weighting == "paper" else super().weighted(values)

    def read(self, force: FloatArray, readings: FloatArray) -> FloatArray:
        """Return what the instrument shows of the model's forces (..., m); (..., n)."""
        return self._reading(force, readings) if self.reads else force

    def predict(self, outcome: Outcome, readings: FloatArray) -> Prediction:
        """Return a complete full solve as the instrument shows it."""
        instrument = readings[: len(INSTRUMENT)]
        force, by = self._corrected(outcome)
        if not self.reads:
            return Prediction(force, by, force, by)
        # Linear in the force but for the zero.
        slope = instrument * (1.0, 0.0, 1.0)
        seen = {name: self._reading(values, slope) for name, values in by.items()}
        seen |= self._reading.derivatives(force, instrument)
        return Prediction(self._reading(force, instrument), seen, force, by)

    @cached_property
    def _reading(self) -> Reading:
        return Reading(self.grid, self.displacement)

    def _corrected(self, outcome: Outcome) -> tuple[FloatArray, dict[str, FloatArray]]:
        curve, grid = outcome.curve, self.grid
        force = curve(grid)
        by = {name: curve.sensitivity(name, grid) for name in curve.sensitivities}
        if self.correction is None:
            return force, by
        c10, c20 = _stiffness(outcome.values)
        factor = self._factor(c10, c20)
        by = {name: factor * values for name, values in by.items()}
        up, beside = c10 * (1 + _STEP), c20 + _STEP * c10
        for name, ends in ((DEEP_C10, (up, c20)), (DEEP_C20, (c10, beside))):
            if name in by:
                step = kpa_to_mpa((ends[0] - c10) + (ends[1] - c20))
                by[name] = by[name] + force * (self._factor(*ends) - factor) / step
        return factor * force, by

    def _factor(self, c10: float, c20: float) -> FloatArray:
        return correction_factor(self.correction, self.grid, np.asarray(c10), np.asarray(c20))


def _stiffness(values: Mapping[str, float]) -> tuple[float, float]:
    """Return C10 and C20 of the deep tissue in kPa, as corrections are tabulated."""
    return mpa_to_kpa(values[DEEP_C10]), mpa_to_kpa(values.get(DEEP_C20, 0.0))

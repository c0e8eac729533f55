"""The difference between a law's curve and the measured one, and what it costs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular

from legfem.identify.correction import Correction, correction_factor
from legfem.identify.forward import SENSITIVITIES, ForwardOutcome
from legfem.identify.settings import Weighting
from legfem.recording import LoadingCurve
from legfem.units import MPA_PER_KPA, FloatArray

_STEP = 1e-4


@dataclass(frozen=True, eq=False)
class Prediction:
    """A full solve on the measured curve's grid, correction included."""

    force: FloatArray
    """(n,), N."""
    sensitivities: Mapping[str, FloatArray]
    """(n,), N/kPa."""

    def jacobian(self, dimensions: int) -> FloatArray:
        """Return the derivatives by C10 (and C20); (n, dimensions), N/kPa."""
        names = ("deep.C10", "deep.C20")[:dimensions]
        return np.column_stack([self.sensitivities[name] for name in names])


@dataclass(frozen=True, eq=False)
class Misfit:
    """How far forces are from the measured curve.

    Parameters
    ----------
    measured : LoadingCurve
        Mean of the trials, with its covariance.
    weighting : {"paper", "covariance"}
        What `objective` sums.
    correction : Correction, optional
        Applied to every force.
    numerical_error, numerical_error_length : float
        Relative standard deviation of the forward model's error, and the distance (mm) over which
        it is correlated.
    """

    measured: LoadingCurve
    weighting: Weighting
    correction: Correction | None
    numerical_error: float
    numerical_error_length: float

    @property
    def displacement(self) -> FloatArray:
        """The grid, mm."""
        return self.measured.displacement

    @cached_property
    def covariance(self) -> FloatArray:
        """Of measured less predicted force at the truth, without the correction's; (n, n), N2."""
        apart = np.abs(self.displacement[:, None] - self.displacement[None, :])
        error = self.numerical_error * self.measured.force
        numerical = np.outer(error, error) * np.exp(-apart / self.numerical_error_length)
        total = self.measured.covariance + numerical
        # Makes the inverse exist for recordings without noise.
        least = 1e-12 * float(np.max(self.measured.force) ** 2)
        return np.asarray(total + least * np.eye(len(total)))

    def covariance_at(self, c10: float, c20: float) -> FloatArray:
        """Return `covariance` with the correction's uncertainty at a stiffness (kPa)."""
        if self.correction is None:
            return self.covariance
        force = self.measured.force
        relative = self.correction.covariance(self.displacement, c10, c20)
        return np.asarray(self.covariance + np.outer(force, force) * relative)

    @cached_property
    def _lower(self) -> FloatArray:
        return np.linalg.cholesky(self.covariance)

    def weighted(self, values: FloatArray) -> FloatArray:
        """Return values (n, ...) scaled so that `objective` is their sum of squares."""
        if self.weighting == "paper":
            return values
        return np.asarray(solve_triangular(self._lower, values, lower=True))

    def cost(self, force: FloatArray) -> FloatArray:
        """Return Eq. 12 (N2) of corrected forces (..., n)."""
        return np.asarray(np.sum((force - self.measured.force) ** 2, axis=-1))

    def residual(self, force: FloatArray) -> FloatArray:
        """Return the weighted residual (n,) of a corrected force (n,)."""
        return self.weighted(force - self.measured.force)

    def objective(self, force: FloatArray) -> FloatArray:
        """Return what is minimised, for corrected forces (..., n)."""
        if self.weighting == "paper":
            return self.cost(force)
        flat = (force - self.measured.force).reshape(-1, force.shape[-1])
        return np.sum(self.weighted(flat.T) ** 2, axis=0).reshape(force.shape[:-1])

    def predict(self, outcome: ForwardOutcome) -> Prediction:
        """Return a complete full solve on the grid."""
        curve, grid = outcome.curve, self.displacement
        force = curve(grid)
        by: dict[str, FloatArray] = {
            name: MPA_PER_KPA * curve.sensitivity(name, grid) for name in SENSITIVITIES
        }
        if self.correction is None:
            return Prediction(force, by)
        c10, c20 = outcome.deep.C10, outcome.deep.C20
        factor = self._factor(c10, c20)
        by = {name: factor * values for name, values in by.items()}
        up, beside = c10 * (1 + _STEP), c20 + _STEP * c10
        by["deep.C10"] = by["deep.C10"] + force * (self._factor(up, c20) - factor) / (up - c10)
        by["deep.C20"] = by["deep.C20"] + force * (self._factor(c10, beside) - factor) / (
            beside - c20
        )
        return Prediction(factor * force, by)

    def _factor(self, c10: float, c20: float) -> FloatArray:
        return correction_factor(
            self.correction, self.displacement, np.asarray(c10), np.asarray(c20)
        )

"""Predictions of a model beside what was measured, and what their difference costs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.linalg import solve_triangular

from legfem.common.units import FloatArray
from legfem.inverse.least_squares import sandwich
from legfem.inverse.outcome import Outcome


class Comparison(ABC):
    """Forces of a model beside n measured ones: what a search needs to know of recordings."""

    @property
    @abstractmethod
    def measured_force(self) -> FloatArray:
        """What is to be met (n,), N."""

    @property
    @abstractmethod
    def covariance(self) -> FloatArray:
        """Of measured less predicted force at the truth; (n, n), N2."""

    def covariance_at(self, values: Mapping[str, float]) -> FloatArray:
        """Return `covariance` with what depends on the model's values; (n, n), N2."""
        return self.covariance

    @property
    @abstractmethod
    def reach(self) -> str:
        """How far a solve has to come, in words."""

    @property
    def in_errors(self) -> bool:
        """Whether the objective is in units of errors: 1 more of it is a standard error."""
        return False

    @abstractmethod
    def reached_by(self, outcome: Outcome) -> bool:
        """Return whether a solve came as far as what was measured."""

    @abstractmethod
    def predict(self, outcome: Outcome, readings: FloatArray) -> Prediction:
        """Return a complete full solve as it is read; ``readings`` (k,) are those of a law."""

    @abstractmethod
    def read(self, force: FloatArray, readings: FloatArray) -> FloatArray:
        """Return what is read (..., n) of the model's forces (..., m)."""

    @property
    @abstractmethod
    def if_deeper(self) -> FloatArray:
        """Change of the measured forces (n,) per relative change of the displacements, N."""

    def weighted(self, values: FloatArray) -> FloatArray:
        """Return values (n, ...) scaled so that `objective` is their sum of squares.

        By the errors, unless a comparison says otherwise.
        """
        return np.asarray(solve_triangular(self._lower, values, lower=True))

    @cached_property
    def _lower(self) -> FloatArray:
        return np.linalg.cholesky(self.covariance)

    def __len__(self) -> int:
        """Return n."""
        return len(self.measured_force)

    @cached_property
    def weighting_matrix(self) -> FloatArray:
        """What `weighted` multiplies with; (n, n)."""
        return self.weighted(np.eye(len(self)))

    def cost(self, force: FloatArray) -> FloatArray:
        """Return Eq. 12 (N2) of forces as read (..., n)."""
        return np.asarray(np.sum((force - self.measured_force) ** 2, axis=-1))

    def residual(self, force: FloatArray) -> FloatArray:
        """Return the weighted residual (..., n) of forces as read (..., n)."""
        flat = (force - self.measured_force).reshape(-1, force.shape[-1])
        return self.weighted(flat.T).T.reshape(force.shape)

    def objective(self, force: FloatArray) -> FloatArray:
        """Return what is minimised but the priors' part, for forces as read (..., n)."""
        return np.asarray(np.sum(self.residual(force) ** 2, axis=-1))


@dataclass(frozen=True, eq=False)
class Prediction:
    """A full solve on the measured curve's grid, correction and instrument included."""

    force: FloatArray
    """(n,), N."""
    sensitivities: Mapping[str, FloatArray]
    """(n,), N per unit of the parameter, by full name."""
    model_force: FloatArray
    """(m,), N: the model's on the misfit's grid, correction included."""
    model_sensitivities: Mapping[str, FloatArray]
    """(m,), N per unit, likewise."""

    def jacobian(self, names: Sequence[str]) -> FloatArray:
        """Return the derivatives by parameters; (n, p), N per unit."""
        return np.column_stack([self.sensitivities[name] for name in names])

    def of(self, span: slice) -> Prediction:
        """Return a part of it, where the model's grid is the measured one."""
        force = self.force[span]
        by = {name: values[span] for name, values in self.sensitivities.items()}
        return Prediction(force, by, force, by)


ErrorSource = Literal["recordings", "differences", "model", "ends", "fibres", "priors"]
"""Readings; a factor by which recordings or specimens differ; the model's numerical error; the
correction for the cylinder's ends; muscle fibres' part in it; what was known beforehand."""


OF_MODEL = "in 3D: "
"""What names of modes begin with that are errors of a leg's own model in 3D."""


Covariances = Mapping[ErrorSource, FloatArray]
"""Of forces (n, n), N2, by source; they add up."""


def total_of(covariances: Covariances) -> FloatArray:
    """Return the sum (n, n), N2."""
    return np.asarray(sum(covariances.values()))


def shares_of_error(gain: FloatArray, covariances: Covariances) -> list[dict[ErrorSource, float]]:
    r"""Return each source's share of the variance of each parameter.

    With the gain :math:`G` by which parameters follow forces and priors, the share of a source of
    covariance :math:`\Sigma_s` in parameter k is :math:`(G \Sigma_s G^T)_{kk}` over the sum of
    these; priors have errors of one.

    Parameters
    ----------
    gain : (p, n + k) array
        Of `legfem.inverse.trial.Linearised`: p parameters, n forces, k priors.
    covariances : mapping
        Of the forces, by source.
    """
    n = len(total_of(covariances))
    of_forces, of_priors = gain[:, :n], gain[:, n:]
    parts: dict[ErrorSource, FloatArray] = {
        source: np.asarray(np.diag(sandwich(of_forces, covariance))) for source, covariance in covariances.items()
    }
    if of_priors.shape[1]:
        parts["priors"] = np.asarray(np.sum(of_priors**2, axis=1))
    whole = np.sum(list(parts.values()), axis=0)
    return [
        {source: float(part[k] / whole[k]) for source, part in parts.items() if whole[k] > 0} for k in range(len(gain))
    ]


def greatest(shares: Mapping[ErrorSource, float]) -> ErrorSource:
    """Return the source of most of an error; the recordings where nothing is known of it."""
    return max(shares, key=lambda source: shares[source], default="recordings")

"""One full solve of a search, and what it says."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.catalogue import Values
from legfem.inverse.comparison import Comparison, Prediction
from legfem.inverse.laws import IdentifiedLaw
from legfem.inverse.least_squares import gain_matrix, with_unit_errors
from legfem.inverse.outcome import Outcome
from legfem.inverse.parameter import Parameter

Stage = Literal["design", "proposal", "genetic"]


@dataclass(frozen=True, eq=False)
class Trial:
    """One full solve of the search."""

    point: FloatArray
    """(p,): the law's free parameters, in the model's units."""
    values: Values
    """Of model and instrument, free and held."""
    outcome: Outcome
    stage: Stage
    prediction: Prediction | None
    """None where the solve stopped short of the measured depth."""
    objective: float
    """What is minimised, priors included; infinite without a prediction."""


type Asking = Generator[tuple[FloatArray, Stage], list[Trial]]
"""Asks for full solves of points (n, p) as often as it needs, and is sent their trials."""


def objective_of(law: IdentifiedLaw, misfit: Comparison, force: FloatArray, points: FloatArray) -> FloatArray:
    """Return what is minimised (...) for forces (..., n), N, at points (..., p)."""
    departures = law.priors.residual(points)
    return np.asarray(misfit.objective(force) + np.sum(departures**2, axis=-1))


def sizes_of(trial: Trial, parameters: Sequence[Parameter]) -> FloatArray:
    """Return what steps (p,) are small against: C10 + C20 of a tissue, values, widths."""
    sizes = []
    for parameter, value in zip(parameters, trial.point, strict=True):
        term, _, name = parameter.name.rpartition(".")
        if name in ("C10", "C20"):
            both = (trial.values.get(f"{term}.{one}", 0.0) for one in ("C10", "C20"))
            sizes.append(sum(both))
        elif parameter.scale == "linear":
            sizes.append(0.5 * (parameter.bounds[1] - parameter.bounds[0]))
        else:
            sizes.append(float(value))
    return np.array(sizes)


@dataclass(frozen=True, eq=False)
class Linearised:
    """The weighted misfit and the priors about a full solve.

    Parameters
    ----------
    law : IdentifiedLaw
        p free parameters, k priors.
    misfit : Misfit
        n differences.
    prediction : Prediction
        Of the full solve.
    point : (p,) array
        Where.
    """

    law: IdentifiedLaw
    misfit: Comparison
    prediction: Prediction
    point: FloatArray

    @property
    def residual(self) -> FloatArray:
        """Weighted differences and departures; (n + k,)."""
        departures = self.law.priors.residual(self.point)
        return np.concatenate([self.misfit.residual(self.prediction.values), departures])

    @property
    def jacobian(self) -> FloatArray:
        """Derivatives of `residual`; (n + k, p)."""
        own = self.misfit.weighted(self.prediction.jacobian(self.law.names))
        return np.vstack([own, self.law.priors.jacobian(self.point)])

    @property
    def gain(self) -> FloatArray:
        """How the parameters follow forces and priors; (p, n + k)."""
        weighting = with_unit_errors(self.misfit.weighting_matrix, len(self.law.priors))
        return gain_matrix(self.jacobian, weighting)

    def errors(self, covariance: FloatArray) -> FloatArray:
        """Return the covariance (p, p) of the parameters' errors from the forces', (n, n)."""
        gain = self.gain
        return np.asarray(gain @ with_unit_errors(covariance, len(self.law.priors)) @ gain.T)

    def at(self, points: FloatArray) -> FloatArray:
        """Return `residual` (..., n + k) at points (..., p), the force linear in the parameters."""
        moved = (points - self.point) @ self.jacobian[: len(self.misfit)].T
        forces = self.misfit.residual(self.prediction.values) + moved
        return np.concatenate([forces, self.law.priors.residual(points)], axis=-1)

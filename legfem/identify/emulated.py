"""The model between its full solves, as the instrument shows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from legfem.common.units import FloatArray
from legfem.identify.coordinates import Coordinates
from legfem.identify.laws import IdentifiedLaw
from legfem.identify.misfit import Compared
from legfem.identify.trial import Trial, objective_of
from legfem.inference.emulator import Emulator, Samples


@dataclass(frozen=True, eq=False)
class Emulated:
    """An emulator of the model's corrected force beside what was measured.

    Parameters
    ----------
    law : IdentifiedLaw
        p free parameters, k priors.
    misfit : Compared
        n differences.
    emulator : Emulator
        Of the force, in `Coordinates`.
    """

    law: IdentifiedLaw
    misfit: Compared
    emulator: Emulator

    @classmethod
    def between(cls, law: IdentifiedLaw, misfit: Compared, trials: Sequence[Trial]) -> Emulated:
        """Return the emulator through full solves, those that have a prediction."""
        complete = [trial for trial in trials if trial.prediction is not None]
        predictions = [trial.prediction for trial in complete if trial.prediction is not None]
        points = np.array([trial.point for trial in complete])
        names = [law.names[k] for k in law.of_model]
        force = np.array([one.model_force for one in predictions])
        by = np.array([[one.model_sensitivities[name] for name in names] for one in predictions])
        coordinates = Coordinates(law)
        slopes = np.einsum(
            "nkm,nkj->njm", by.reshape(len(force), len(names), force.shape[1]), coordinates.derivatives(points)
        )
        return cls(law, misfit, Emulator(Samples(coordinates.of(points), force, slopes)))

    def force(self, points: FloatArray) -> FloatArray:
        """Return what the instrument shows (..., n), N, at points (..., p)."""
        force = self.emulator(Coordinates(self.law).of(points))
        return self.misfit.read(force, self.law.readings(points))

    def residual(self, points: FloatArray) -> FloatArray:
        """Return weighted differences and departures (..., n + k) of points (..., p)."""
        own = self.misfit.residual(self.force(points))
        return np.concatenate([own, self.law.priors.residual(points)], axis=-1)

    def objective(self, points: FloatArray) -> FloatArray:
        """Return what is minimised (...) at points (..., p)."""
        return objective_of(self.law, self.misfit, self.force(points), points)

    def cost(self, points: FloatArray) -> FloatArray:
        """Return the cost (...) at points (..., p), without the priors."""
        return self.misfit.cost(self.force(points))

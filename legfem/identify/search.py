"""The search: pygad on an emulator, full solves where it goes, until both agree."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.optimize import least_squares

from legfem.identify.domain import Domain, Known
from legfem.identify.emulator import Emulator, Samples
from legfem.identify.forward import DeepTissue, ForwardOutcome
from legfem.identify.genetic import evolve
from legfem.identify.intervals import newton_step, sandwich
from legfem.identify.laws import IdentifiedLaw
from legfem.identify.misfit import Misfit, Prediction
from legfem.identify.result import Generation
from legfem.identify.settings import IdentificationSettings
from legfem.identify.solver import FullSolver
from legfem.units import FloatArray

# Converged: what is left to move, over the standard error, or over the value.
_STEP_OF_ERROR, _STEP_OF_VALUE = 1e-3, 1e-5
# ... and the emulator's surprise at the last solve, over the standard error of the force or over
# the greatest force.
_SURPRISE_OF_ERROR, _SURPRISE_OF_FORCE = 0.1, 1e-4

Stage = Literal["design", "proposal", "bound", "genetic"]


@dataclass(frozen=True, eq=False)
class Trial:
    """One full solve of the search."""

    outcome: ForwardOutcome
    stage: Stage
    prediction: Prediction | None
    """None where the solve stopped short of the measured depth."""
    objective: float
    """What is minimised; NaN without a prediction."""

    @property
    def stiffness(self) -> FloatArray:
        """C10 and C20, kPa."""
        return np.array([self.outcome.deep.C10, self.outcome.deep.C20])


class SearchFailed(Exception):
    """No full solve, or too few, reached the measured depth."""


@dataclass(eq=False)
class Search:
    """One law's search as it goes: the full solves so far, and the generations."""

    law: IdentifiedLaw
    misfit: Misfit
    settings: IdentificationSettings
    solver: FullSolver
    trials: list[Trial] = field(default_factory=list)
    generations: list[Generation] = field(default_factory=list)
    converged: bool = False
    emulator_error: float = math.nan
    """N, at the last proposal, before it was solved."""

    @property
    def domain(self) -> Domain:
        """Bounds and genes."""
        return Domain(self.settings.bounds, self.law.dimensions)

    @property
    def complete(self) -> list[Trial]:
        """Solves that reached the measured depth."""
        return [trial for trial in self.trials if trial.prediction is not None]

    @property
    def best(self) -> Trial:
        """The complete solve of the least objective."""
        if not self.complete:
            raise SearchFailed(
                f"no full solve reached {self.misfit.displacement[-1]:g} mm; the last stopped: "
                f"{self.trials[-1].outcome.reason}"
            )
        return min(self.complete, key=lambda trial: trial.objective)

    def solve(self, points: Sequence[DeepTissue], stage: Stage) -> list[Trial]:
        """Solve points in full, and remember them."""
        trials = [self._trial(outcome, stage) for outcome in self.solver.solve(points)]
        self.trials += trials
        return trials

    def _trial(self, outcome: ForwardOutcome, stage: Stage) -> Trial:
        # A curve that stops short says nothing about the greatest forces.
        if not outcome.complete or outcome.curve.depth < self.misfit.displacement[-1] - 1e-9:
            return Trial(outcome, stage, None, math.nan)
        prediction = self.misfit.predict(outcome)
        return Trial(outcome, stage, prediction, float(self.misfit.objective(prediction.force)))

    def emulator(self) -> Emulator:
        """Return the emulator of all complete solves of this law."""
        trials = [trial for trial in self.complete if trial.outcome.deep.D2 == self.law.D2]
        stiffness = np.array([trial.stiffness for trial in trials])
        predictions = [trial.prediction for trial in trials if trial.prediction is not None]
        return Emulator(
            Samples(
                stiffness[:, 0],
                stiffness[:, 1],
                np.array([one.force for one in predictions]),
                np.array([one.sensitivities["deep.C10"] for one in predictions]),
                np.array([one.sensitivities["deep.C20"] for one in predictions]),
            ),
            self.law.dimensions,
        )

    def known(self) -> Known:
        """Return where the emulator is to be trusted."""
        failed = [trial.stiffness for trial in self.trials if trial.prediction is None]
        return Known(
            np.array([trial.stiffness for trial in self.complete]),
            np.array(failed).reshape(-1, 2),
        )

    def run(self) -> None:
        """Search until the emulator's optimum and the full model's agree."""
        design = [self.law.deep(*point) for point in self.domain.design()]
        self.solve(design, "design")
        most = self.settings.most_solves
        attempt = 0
        while len(self.trials) < most and not self.converged:
            if len(self.complete) < 2:
                self._retreat()
                continue
            self._refine(attempt)
            attempt += 1

    def _retreat(self) -> None:
        """Solve a stiffer tissue: those deform less and reach their depth."""
        stiffest = max(trial.stiffness[0] for trial in self.trials)
        high = self.settings.bounds.c10[1]
        if stiffest >= high:
            raise SearchFailed(
                f"too few full solves reached {self.misfit.displacement[-1]:g} mm; the last "
                f"stopped: {self.trials[-1].outcome.reason}"
            )
        low = self.settings.bounds.c20[0]
        self.solve([self.law.deep(min(2 * stiffest, high), low)], "design")

    def _refine(self, attempt: int) -> None:
        emulator = self.emulator()
        proposal = self._proposal(emulator, attempt)
        best = self.best
        if attempt and self._settled(best, proposal):
            self.converged = True
            return
        point = self.law.deep(*proposal)
        if any(trial.outcome.deep == point for trial in self.trials):
            # The emulator can't be bettered there: go by the full model's own derivatives.
            point = self.law.deep(*self._newton(best))
            if any(trial.outcome.deep == point for trial in self.trials):
                self.converged = self._stationary(best)
                self.trials_exhausted = True
                return
        expected = emulator(point.C10, point.C20)
        (trial,) = self.solve([point], "proposal")
        if trial.prediction is not None:
            self.emulator_error = float(np.max(np.abs(trial.prediction.force - expected)))

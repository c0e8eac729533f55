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

# Converged: the emulator's optimum lies this near the best full solve, over the standard error or
# over the stiffness ...
_AGREE_OF_ERROR, _AGREE_OF_VALUE = 0.1, 2e-3
# ... and the full model's own Gauss-Newton step is no longer than this.
_STEP_OF_ERROR, _STEP_OF_VALUE = 1e-3, 2e-5
_LAST_STEP_OF_ERROR = 0.02

Stage = Literal["design", "proposal", "genetic"]


class SearchError(Exception):
    """Too few full solves reached the measured depth."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One full solve of the search."""

    outcome: ForwardOutcome
    stage: Stage
    prediction: Prediction | None
    """None where the solve stopped short of the measured depth."""
    objective: float
    """What is minimised; infinite without a prediction."""

    @property
    def stiffness(self) -> FloatArray:
        """C10 and C20, kPa."""
        return np.array([self.outcome.deep.C10, self.outcome.deep.C20])


@dataclass(eq=False)
class Search:
    """One law's search as it goes."""

    law: IdentifiedLaw
    misfit: Misfit
    settings: IdentificationSettings
    solver: FullSolver
    trials: list[Trial] = field(default_factory=list)
    """All full solves, in the order asked for."""
    generations: list[Generation] = field(default_factory=list)
    converged: bool = False
    emulator_error: float = math.nan
    """N: the greatest, at the last proposal, before that was solved."""

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
        return min(self.complete, key=lambda trial: trial.objective)

    def design(self) -> list[DeepTissue]:
        """Return what to solve first."""
        return [self.law.deep(*point) for point in self.domain.design()]

    def solve(self, points: Sequence[DeepTissue], stage: Stage) -> list[Trial]:
        """Solve points in full, and remember them."""
        trials = [self._trial(outcome, stage) for outcome in self.solver.solve(points)]
        self.trials += trials
        return trials

    def _trial(self, outcome: ForwardOutcome, stage: Stage) -> Trial:
        # A curve that stops short says nothing about the greatest forces.
        if not outcome.complete or outcome.curve.depth < self.misfit.displacement[-1] - 1e-9:
            return Trial(outcome, stage, None, math.inf)
        prediction = self.misfit.predict(outcome)
        return Trial(outcome, stage, prediction, float(self.misfit.objective(prediction.force)))

    def emulator(self) -> Emulator:
        """Return the emulator of all complete solves."""
        predictions = [trial.prediction for trial in self.complete if trial.prediction is not None]
        stiffness = np.array([trial.stiffness for trial in self.complete])
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

    def run(self) -> None:
        """Search until the emulator's optimum and the full model's agree."""
        self.solve(self.design(), "design")
        while len(self.complete) < 2:
            self._stiffen()
        for attempt in range(self.settings.most_solves):
            emulator = self.emulator()
            proposal = self.propose(emulator, attempt)
            # Near the optimum the full model's own derivatives are exact where the emulator isn't.
            near = self._is_short(proposal - self.best.stiffness, _AGREE_OF_ERROR, _AGREE_OF_VALUE)
            if near and self.is_stationary():
                self.converged = True
                return
            if near:
                proposal = self.best.stiffness + self.newton_step()
            point = self.law.deep(*proposal)
            if self._solved(point):
                # The model isn't smooth enough for a shorter step to gain anything.
                self.converged = near and self._is_short(
                    self.newton_step(), _LAST_STEP_OF_ERROR, _STEP_OF_VALUE
                )
                return
            if len(self.trials) >= self.settings.most_solves:
                return
            expected = emulator(point.C10, point.C20)
            (trial,) = self.solve([point], "proposal")
            if trial.prediction is not None:
                self.emulator_error = float(np.max(np.abs(trial.prediction.force - expected)))

    def propose(self, emulator: Emulator, attempt: int) -> FloatArray:
        """Return the optimum (C10, C20; kPa) on the emulator, where that is to be trusted."""
        domain = self.domain
        failed = [trial.stiffness for trial in self.trials if trial.prediction is None]
        known = Known(
            np.array([trial.stiffness for trial in self.complete]),
            np.array(failed).reshape(-1, 2),
        )

        def trusted(genes: FloatArray) -> FloatArray:
            return domain.inside(known.nearest_trusted(domain.stiffness(np.atleast_2d(genes))))

        def objective(genes: FloatArray) -> FloatArray:
            return self.misfit.objective(emulator(*trusted(genes).T))

        def residual(genes: FloatArray) -> FloatArray:
            return self.misfit.residual(emulator(*domain.stiffness(genes)))

        start = domain.genes(self.best.stiffness)
        evolution = evolve(
            objective, start[None], self.settings.genetic, self.settings.seed + attempt
        )
        self._remember(
            emulator, np.array([trusted(g)[0] for g, _ in evolution.generations]), attempt
        )
        candidates = [start]
        for first in (evolution.best, start):
            candidates.append(_polished(residual, first))
            if self.law.dimensions == 2:
                candidates.append(
                    np.append(
                        _polished(lambda g: residual(np.append(g, 0.0)), candidates[-1][:1]), 0.0
                    )
                )
        costs = objective(np.array(candidates))
        return trusted(candidates[int(np.argmin(costs))])[0]

    def newton_step(self) -> FloatArray:
        """Return the Gauss-Newton step (2,) in kPa from the best full solve, within bounds."""
        best, bounds, p = self.best, self.settings.bounds, self.law.dimensions
        assert best.prediction is not None
        limits = np.array([bounds.c10, bounds.c20])[:p] - best.stiffness[:p, None]
        step = newton_step(self.misfit, best.prediction, p, limits)
        return np.append(step, np.zeros(2 - p))

    def standard_error(self) -> FloatArray:
        """Return the standard errors (2,) in kPa at the best full solve; 0 for a fixed C20."""
        best, p = self.best, self.law.dimensions
        assert best.prediction is not None
        spread = sandwich(self.misfit, best.prediction.jacobian(p), self.misfit.covariance)
        return np.append(np.sqrt(np.diag(spread)), np.zeros(2 - p))

    def is_stationary(self) -> bool:
        """Whether Gauss-Newton hardly leaves the best full solve."""
        return self._is_short(self.newton_step(), _STEP_OF_ERROR, _STEP_OF_VALUE)

    def is_near_optimum(self) -> bool:
        """Whether Gauss-Newton's step from the best full solve is well within its errors."""
        return self._is_short(self.newton_step(), _AGREE_OF_ERROR, _AGREE_OF_VALUE)

    def _is_short(self, step: FloatArray, of_error: float, of_value: float) -> bool:
        scale = np.maximum(of_error * self.standard_error(), of_value * self.best.stiffness.sum())
        return bool(np.all(np.abs(step) <= scale))

    def _solved(self, point: DeepTissue) -> bool:
        return any(trial.outcome.deep == point for trial in self.trials)

    def _stiffen(self) -> None:
        """Solve a stiffer tissue: that deforms less and reaches its depth."""
        stiffest = max(float(trial.stiffness[0]) for trial in self.trials)
        low, high = self.settings.bounds.c20[0], self.settings.bounds.c10[1]
        if stiffest >= high or len(self.trials) >= self.settings.most_solves:
            raise SearchError(
                f"too few full solves reach {self.misfit.displacement[-1]:g} mm "
                f"(the last stopped: {self.trials[-1].outcome.reason}); "
                "use less of the recordings with --depth"
            )
        self.solve([self.law.deep(min(2 * stiffest, high), low)], "design")

    def _remember(self, emulator: Emulator, path: FloatArray, attempt: int) -> None:
        costs = self.misfit.cost(emulator(*path.T))
        self.generations += [
            Generation(attempt, number, float(c10), float(c20), float(cost))
            for number, ((c10, c20), cost) in enumerate(zip(path, costs, strict=True))
        ]


def _polished(residual: object, start: FloatArray) -> FloatArray:
    assert callable(residual)
    fit = least_squares(
        residual, start, bounds=(0.0, 1.0), method="dogbox", jac="3-point",
        xtol=1e-12, ftol=1e-14, gtol=1e-14, max_nfev=60,
    )  # fmt: skip
    return np.asarray(fit.x)

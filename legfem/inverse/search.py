"""The search: a minimiser on an emulator, full solves where it goes, until both agree."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from legfem.common.errors import UnsolvedError
from legfem.common.units import FloatArray
from legfem.inverse.catalogue import DEEP_C20, IdentifiedLaw, Values, model_values
from legfem.inverse.comparison import Comparison
from legfem.inverse.designs import design, far_ends, half_way, stiffer
from legfem.inverse.least_squares import gauss_newton_step, polished, polished_with
from legfem.inverse.outcome import FullSolver, Outcome, key_of_values
from legfem.inverse.parameter import Domain
from legfem.inverse.settings import IdentificationSettings
from legfem.inverse.trial import Asking, Coordinates, Emulated, Linearised, Stage, Trial, Trust, objective_of, sizes_of

# Converged: the emulator's optimum lies this near the best full solve, over the standard error or
# over the value ...
_AGREE_OF_ERROR, _AGREE_OF_VALUE = 0.1, 2e-3
# ... and the full model's own Gauss-Newton step is no longer than this.
_STEP_OF_ERROR, _STEP_OF_VALUE = 1e-3, 2e-5
_LAST_STEP_OF_ERROR, _LAST_STEP_OF_VALUE = 0.05, 5e-3
# Of what the sum of squares rises by within a standard error: what nothing is gained by, and what solves by other steps
# differ by; and what is told however little is known of each number.
_FLAT, _UNTOLD, _TOLD = 0.1, 1.0, 5.0
# Distance over the standard error that is near enough where another search, by other weights, goes on.
_NEAR_OF_ERROR = 0.5
# Of the least sum of squares: what a further solve has to gain where numbers are read off a curve.
_WORTH = 1e-4
# Optima of the emulator, one after another, that full solves showed to be none.
_REFUTED = 3
# Share of the sum of squares that derivatives expect: what of it contradicts the errors already does so surely.
_SURELY = 0.7
# Complete solves, the best first, from which an optimum among many parameters is polished.
_MORE_STARTS = 4
# Parameters of the model beyond which no emulator is drawn, and the shortest share of a step that is tried.
_MOST_EMULATED, _LEAST_SHARE = 16, 0.1


def is_settled(gained: float) -> bool:
    """Whether a solve lowered the sum of squares by a share that isn't worth another one.

    One that raised it says nothing of the kind: the emulator was wrong there.
    """
    return 0.0 <= gained <= _WORTH


class SearchError(UnsolvedError):
    """Too few full solves reached the measured depth."""


@dataclass(eq=False)
class Search[C: Comparison]:
    """One law's search as it goes."""

    law: IdentifiedLaw
    misfit: C
    settings: IdentificationSettings
    solver: FullSolver
    trials: list[Trial] = field(default_factory=list)
    """All full solves, in the order asked for."""
    converged: bool = False
    begun: bool = False
    """Whether an earlier search, by other weights, was near the optimum: none by the minimiser is needed then."""
    ends_near: bool = False
    """Whether it is enough to come near the optimum: another search goes on from there, by other weights."""
    emulator_error: float = math.nan
    """Largest force error (N) of the emulator at the last accepted point; NaN before there is one."""
    _found: tuple[int, Trial] | None = field(default=None, init=False)
    """The best of so many solves."""

    @property
    def domain(self) -> Domain:
        """Bounds and genes."""
        return Domain(self.law.parameters)

    @property
    def coordinates(self) -> Coordinates:
        """The emulator's."""
        return Coordinates(self.law)

    @property
    def complete(self) -> list[Trial]:
        """Solves that reached the measured depth."""
        return [trial for trial in self.trials if trial.prediction is not None]

    @property
    def best(self) -> Trial:
        """The complete solve of the least objective.

        Curves solved in other steps differ by some 1e-4, which objectives near an optimum don't. Of solves that errors
        can't tell apart, the best is the one from which the model's own step is shortest.
        """
        if self._found is None or self._found[0] != len(self.trials):
            least = min(self.complete, key=lambda trial: trial.objective)
            limit = least.objective + _UNTOLD * self._rise_of_error(least)
            as_good = [trial for trial in self.complete if trial.objective <= limit]
            best = least if len(as_good) < 2 else min(as_good, key=self._errors_away)
            self._found = len(self.trials), best
        return self._found[1]

    def _errors_away(self, trial: Trial) -> float:
        """Return the length of the Gauss-Newton step from a complete solve, in standard errors."""
        return float(np.max(np.abs(self.newton_step(trial)) / np.maximum(self.standard_error(trial), 1e-300)))

    def solve(self, points: FloatArray, stage: Stage) -> list[Trial]:
        """Solve points (n, p) in full, and remember them."""
        values = [self.law.values(point) for point in points]
        outcomes = self.solver.solve([model_values(one) for one in values])
        trials = [
            self._trial(point, one, outcome, stage)
            for point, one, outcome in zip(points, values, outcomes, strict=True)
        ]
        self.trials += trials
        return trials

    def _trial(self, point: FloatArray, values: Values, outcome: Outcome, stage: Stage) -> Trial:
        # A curve that stops short says nothing about the largest forces.
        if not self.misfit.told_by(outcome):
            return Trial(point, values, outcome, stage, None, math.inf)
        prediction = self.misfit.predict(outcome, self.law.readings(point))
        objective = objective_of(self.law, self.misfit, prediction.values, point)
        return Trial(point, values, outcome, stage, prediction, float(objective))

    def beside(self, misfit: C) -> "Search[C]":
        """Return a search beside another reading of the recordings, with what was solved so far."""
        other = replace(self, misfit=misfit, trials=[], converged=False, begun=True)
        other.trials += [other._trial(one.point, one.values, one.outcome, one.stage) for one in self.trials]
        return other

    def reread(self, trial: Trial) -> Trial:
        """Return another search's solve as this one's comparison reads it."""
        point = self.law.point({**self.law.fixed, **trial.values})
        read = self._trial(point, trial.values, trial.outcome, trial.stage)
        return trial if read.prediction is None else read

    def emulated(self) -> Emulated:
        """Return the model between all complete solves."""
        return Emulated.between(self.law, self.misfit, self.complete)

    def linearised(self, trial: Trial) -> Linearised:
        """Return the misfit about a complete full solve."""
        assert trial.prediction is not None
        return Linearised(self.law, self.misfit, trial.prediction, trial.point)

    def asking(self) -> Asking:
        """Search until the emulator's optimum and the full model's agree.

        Others solve what is asked for: see `legfem.inverse.searches`.

        Raises
        ------
        SearchError
            If too few full solves reach the measured depth.
        """
        yield from self._beginning()
        if len(self.law.of_model) > _MOST_EMULATED:
            yield from self._by_steps()
            return
        gained, refuted = math.inf, 0
        reads = len(self.law.of_model) < len(self.law.parameters)  # no solve has the others: an emulator is exact
        for attempt in range(self.settings.most_solves):
            if self.misfit.contradicts(_SURELY * self._least_expected()):
                self.converged = True
                return
            emulated = self.emulated()
            proposal = self.propose(emulated, attempt)
            # Near the optimum the full model's own derivatives are exact where the emulator isn't.
            near = self._agrees(emulated, proposal, _AGREE_OF_ERROR)
            if self.ends_near and self._agrees(emulated, proposal, _NEAR_OF_ERROR):
                self.converged = True
                return
            step = self.domain.inside(self.best.point + self.newton_step())
            # Along a curved valley it goes too far; the emulator knows better once that is solved.
            tried = self._solved(step)
            settled = self.is_stationary() or self._moves_little() or (reads and is_settled(gained))
            untold = -gained * self.best.objective < _UNTOLD * self._rise_of_error()
            rough = untold and self._gains_nothing(emulated, proposal, _UNTOLD)
            if ((near or rough) and settled) or (near and tried and self._is_settled_at(step, emulated, proposal)):
                ends = far_ends(self.linearised(self.best), self.trials)
                if len(ends) and len(self.trials) + len(ends) <= self.settings.most_solves:
                    yield ends, "design"
                    continue
                self.converged = True
                return
            short = near and self._is_near(step, _AGREE_OF_ERROR)
            if refuted >= _REFUTED and (rough or short or (self._wide and self.is_stationary())):
                self.converged = True
                return
            # Where forces grow without measure an emulator is wrong between its solves.
            by_newton = not tried and (near or (self._wide and gained < 0))
            if by_newton:
                proposal = step
            if self._wide and not near and self._solved(proposal):
                best = self.best.point[None]
                proposal = half_way(self.coordinates, proposal[None], best)[0]
            if self._solved(proposal) or len(self.trials) >= self.settings.most_solves:
                return
            expected, before = emulated.values(proposal), self.best.objective
            (trial,) = yield proposal[None], "proposal"
            gained = 1 - trial.objective / before if before > 0 else 0.0
            if not by_newton:
                refuted = refuted + 1 if gained < 0 or trial is not self.best else 0
            if trial.prediction is not None and trial is self.best:
                self.emulator_error = float(np.max(np.abs(self.misfit.of_force(trial.prediction.values - expected))))

    def _by_steps(self) -> Asking:
        """Take the full model's own steps, and shorter ones where they lead up."""
        share = 1.0
        while len(self.trials) < self.settings.most_solves and share > _LEAST_SHARE:
            step = self.newton_step()
            if self._is_short(step, _AGREE_OF_ERROR, 0.0):
                self.converged = True
                return
            (trial,) = yield self.domain.inside(self.best.point + share * step)[None], "proposal"
            share = min(2 * share, 1.0) if trial is self.best else 0.5 * share

    def _beginning(self) -> Asking:
        if not self.trials:
            yield self.domain.inside(design(self.law, self.settings.seed)), "design"
        while not self.complete:
            yield self._stiffer(), "design"
        if self._wide and not self.begun and (failed := [one.point for one in self.trials if one.prediction is None]):
            known = np.array([trial.point for trial in self.complete])
            yield half_way(self.coordinates, np.array(failed), known), "design"

    def propose(self, emulated: Emulated, attempt: int) -> FloatArray:
        """Return the optimum (p,) on the emulator, where that is to be trusted."""
        domain, trust = self.domain, self.trust

        def trusted(genes: FloatArray) -> FloatArray:
            points = domain.values(np.atleast_2d(genes))
            at = self.coordinates.of(points)
            nearest, share = trust.share_of_way(at)
            moved = self.coordinates.points(nearest + share[:, None] * (at - nearest), points)
            return domain.inside(np.where(share[:, None] < 1.0, moved, points))

        def cost(genes: FloatArray) -> FloatArray:
            return emulated.objective(trusted(genes))

        def residual(genes: FloatArray) -> FloatArray:
            return emulated.residual(domain.values(genes))

        start = domain.genes(self.best.point)
        candidates, starts = [start], [start]
        if not self.begun:
            found = self.settings.minimiser(cost, start[None], self.settings.seed + attempt)
            starts.insert(0, found.best)
        if self._wide:
            known = sorted(self.complete, key=lambda trial: trial.objective)[1:_MORE_STARTS]
            starts += [domain.genes(trial.point) for trial in known]
        for first in starts:
            candidates.append(polished(residual, first))
            if (limit := self.law.index(DEEP_C20)) is not None and len(start) > 1:
                candidates.append(polished_with(residual, candidates[-1], limit, 0.0))
        costs = cost(np.array(candidates))
        return trusted(candidates[int(np.argmin(costs))])[0]

    def newton_step(self, trial: Trial | None = None) -> FloatArray:
        """Return the Gauss-Newton step (p,) from a full solve, or the best one, within bounds."""
        linear = self.linearised(trial or self.best)
        return gauss_newton_step(linear.jacobian, linear.residual, self.domain.bounds - linear.point[:, None])

    def _least_expected(self) -> float:
        """Return the sum of squares that the full model's own step leads to, by the derivatives at the best solve."""
        linear = self.linearised(self.best)
        left = linear.residual + linear.jacobian @ self.newton_step()
        return float(left @ left)

    def standard_error(self, trial: Trial | None = None) -> FloatArray:
        """Return the standard errors (p,) at a full solve, or the best one."""
        return np.sqrt(np.diag(self.linearised(trial or self.best).errors(self.misfit.covariance)))

    def is_stationary(self) -> bool:
        """Whether Gauss-Newton hardly leaves the best full solve."""
        return self._is_short(self.newton_step(), _STEP_OF_ERROR, _STEP_OF_VALUE)

    def _moves_little(self) -> bool:
        """Whether Gauss-Newton's step is too short, for errors and for values, to be worth a solve."""
        step = self.newton_step()
        return self._is_short(step, _LAST_STEP_OF_ERROR, 0.0) and self._is_short(step, 0.0, _LAST_STEP_OF_VALUE)

    def _agrees(self, emulated: Emulated, proposal: FloatArray, of_error: float) -> bool:
        """Whether the emulator's optimum lies near the best full solve, and gains nothing there that errors tell.

        Of numbers that are hardly known any point is near.
        """
        return self._is_near(proposal, of_error) and self._gains_nothing(emulated, proposal, _TOLD)

    def _is_near(self, point: FloatArray, of_error: float) -> bool:
        """Whether a point (p,) lies near the best full solve, for errors or for values."""
        return self._is_short(point - self.best.point, of_error, _AGREE_OF_VALUE)

    def _is_short(self, step: FloatArray, of_error: float, of_value: float) -> bool:
        sizes = sizes_of(self.best, self.law.parameters)
        scale = np.maximum(of_error * self.standard_error(), of_value * sizes)
        return bool(np.all(np.abs(step) <= scale))

    def _is_settled_at(self, step: FloatArray, emulated: Emulated, proposal: FloatArray) -> bool:
        """Whether nothing is to be gained after the full model's own step was solved.

        The model isn't smooth enough for a shorter one, or the step or the emulator's optimum fits as well as the best
        solve, by what errors leave open.
        """
        if self._is_short(self.newton_step(), _LAST_STEP_OF_ERROR, _STEP_OF_VALUE):
            return True
        key = key_of_values(self.law.values(step))
        (tried, *_) = (trial for trial in self.trials if key_of_values(trial.values) == key)
        as_good = tried.objective - self.best.objective < _FLAT * self._rise_of_error()
        return as_good or self._gains_nothing(emulated, proposal)

    def _gains_nothing(self, emulated: Emulated, proposal: FloatArray, open_share: float = _AGREE_OF_ERROR**2) -> bool:
        """Whether the emulator's optimum lowers the sum of squares by less than errors leave open."""
        return self.best.objective - float(emulated.objective(proposal)) < open_share * self._rise_of_error()

    def _rise_of_error(self, trial: Trial | None = None) -> float:
        """Return by how much the sum of squares rises within the least known direction's standard error."""
        best = self.linearised(trial or self.best)
        curvature = np.diag(np.linalg.pinv(best.jacobian.T @ best.jacobian))
        shown = curvature > 0.0
        return float(np.min(self.standard_error(trial)[shown] ** 2 / curvature[shown], initial=np.inf))

    def _solved(self, point: FloatArray) -> bool:
        key = key_of_values(self.law.values(point))
        return any(key_of_values(trial.values) == key for trial in self.trials)

    @property
    def trust(self) -> Trust:
        """Where the emulator is trusted."""

        def at(trials: Sequence[Trial]) -> FloatArray:
            points = np.array([trial.point for trial in trials])
            return self.coordinates.of(points.reshape(-1, len(self.law.parameters)))

        failed = [trial for trial in self.trials if trial.prediction is None]
        return Trust(at(self.complete), at(failed))

    @property
    def _wide(self) -> bool:
        """Whether a design can't hold all corners: failures then leave whole regions unknown."""
        return len(self.law.of_model) > 2

    def _stiffer(self) -> FloatArray:
        point = stiffer(self.law, np.array([trial.point for trial in self.trials]))
        if point is None or len(self.trials) >= self.settings.most_solves:
            last = self.trials[-1].outcome
            if last.complete and self.misfit.reached_by(last):
                unseen = ", ".join(self.misfit.unseen_in(last))
                raise SearchError(f"no full solve shows all that was recorded: {unseen}; leave that out")
            raise SearchError(
                f"too few full solves reach {self.misfit.reach} (the last stopped: {last.reason}); "
                "use less of the recordings' depth"
            )
        return point[None]

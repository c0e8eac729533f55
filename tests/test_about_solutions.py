"""Fits about full solutions, on responses in closed form, no finite elements."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pytest
from making_diagnosis import GRID, fat, force_at, problem_of, ramps

from legfem.common.units import FloatArray
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.linearised import LinearisedProblem
from legfem.inverse.map_fit import REFITS, base_about_solution, fit, refitted_about_solutions
from legfem.inverse.predictor import Responses
from legfem.inverse.responses import Columns, PathRequest, SolvedResponses
from legfem.mechanisms import mechanism_named

SUPPORT = mechanism_named("support-compliance")


@dataclass
class Folding:
    """Full solutions: beyond a depth each is above the library's by a share of its own."""

    responses: Responses
    shares: Iterator[float]
    solved: list[float] = field(default_factory=list)

    def __getattr__(self, name: str) -> object:
        return getattr(self.responses, name)

    def curve(self, c10: FloatArray, c20: FloatArray) -> FloatArray:
        self.solved += c10.tolist()
        share = next(self.shares)
        return self.responses.curve(c10, c20) * (1 + share * np.tanh(GRID - 12.0).clip(0.0))


def supported() -> LinearisedProblem:
    """Return recordings of a leg on a spring, which are fitted with it."""
    return problem_of(ramps(), {"support-compliance.compliance": 0.3}, seed=3)[0]


def test_a_refit_that_stays_needs_no_second_solution():
    problem = supported()
    fitted = fit(problem, (SUPPORT,), {DEEP_C10: 0.0007, DEEP_C20: 0.0004})
    alike = Folding(problem.predictor.responses, iter([0.0, np.nan]))
    refit = refitted_about_solutions(alike, fitted)
    assert len(alike.solved) == 1
    assert np.allclose(refit.problem.predictor.offset, 0.0)
    assert refit.cost == pytest.approx(fitted.cost)


@pytest.mark.parametrize(
    ("shares", "solved"), [((0.004, 0.03, -0.03), REFITS), ((0.03, 0.004, -0.03), REFITS), ((0.03, -0.03, 0.0), 3)]
)
def test_of_solutions_on_several_branches_that_stands_which_leaves_least(shares, solved):
    problem = supported()
    fitted = fit(problem, (SUPPORT,), {DEEP_C10: 0.0007, DEEP_C20: 0.0004})
    every = [*shares, *[0.03, -0.03] * REFITS][:REFITS]
    folding = Folding(problem.predictor.responses, iter(every))
    refit = refitted_about_solutions(folding, fitted)
    assert len(folding.solved) == solved
    assert refit.cost < fitted.cost + 2.0
    again = fit(refit.problem, (SUPPORT,), refit.values)
    assert again.cost == pytest.approx(refit.cost, abs=1e-3), "the problem is the fit's own"


def test_where_every_solution_stops_there_is_no_refit():
    problem = supported()
    fitted = fit(problem, (SUPPORT,), {DEEP_C10: 0.0007, DEEP_C20: 0.0004})
    stopped = Folding(problem.predictor.responses, iter([np.nan, np.nan]))
    assert refitted_about_solutions(stopped, fitted) is None


def test_the_base_model_is_refitted_about_its_solution():
    problem, base = problem_of(ramps(), seed=5)
    higher = Folding(problem.predictor.responses, iter([0.02]))
    about, refit, error = base_about_solution(problem, base, higher)
    assert 0.01 < error < 0.03
    assert refit.prediction.max() == pytest.approx(base.prediction.max(), rel=0.01)
    assert np.abs(about.predictor.offset).max() == pytest.approx(error * base.prediction.max())
    assert base_about_solution(problem, base, None)[1] is base


class Pressed(SolvedResponses):
    """Full solutions in closed form, a tenth above the library's effect of the fat."""

    def _solve(self, asked: PathRequest) -> Columns:
        self._made.append(asked)
        softer = np.log(asked.solution.scaled.get("superficial.C10", 1.0))
        return {"force": 1.01 * force_at(*asked.stiffness, self.grid) * (1 + 1.1 * softer * fat(self.grid))}


def test_a_mechanism_is_confirmed_by_its_own_solution_alone():
    stiffer = mechanism_named("superficial-stiffness")
    problem = problem_of(ramps(), {"superficial-stiffness.factor": 2.0}, seed=3)[0]
    solved = Pressed(None, GRID[-1], None, {})
    fitted = fit(problem, (stiffer,), {DEEP_C10: 0.0007, DEEP_C20: 0.0004})
    refit = refitted_about_solutions(solved, fitted)
    assert all("superficial.C10" in one.solution.scaled for one in solved._made), "none of the base model"
    values = refit.values
    stiffness = values[DEEP_C10], values[DEEP_C20]
    factor = values["superficial-stiffness.factor"]
    whole = 1.01 * force_at(*stiffness, GRID) * (1 + 1.1 * np.log(factor) * fat(GRID))
    at = refit.problem.predictor.observed.displacement
    deep = at > 3.0
    onset = np.array([values[f"trial{k + 1}.onset"] for k in refit.problem.predictor.observed.trial])
    np.testing.assert_allclose(refit.prediction[deep], np.interp(at - onset, GRID, whole)[deep], rtol=6e-3)

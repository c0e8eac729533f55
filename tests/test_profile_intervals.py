"""Intervals of a stocking's stiffnesses by profile likelihood, against closed forms."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from legfem.common.progress import Silent
from legfem.inverse.catalogue import IdentifiedLaw
from legfem.inverse.comparison import Comparison, Prediction
from legfem.inverse.emulator import Kriging
from legfem.inverse.intervals import quantile
from legfem.inverse.outcome import FullSolver, Outcome
from legfem.inverse.searches import Found, Searches
from legfem.stockings.equilibrium import PARAMETERS
from legfem.stockings.identification import MOST, SAMPLED_AT, SEARCH, profile_intervals
from legfem.stockings.scan_fit import by_name, stiffness_priors

BEST = np.array([3e-3, 5e-3])
TIMES = quantile(0)


@dataclass(frozen=True, eq=False)
class Measured(Comparison):
    """Compliances that are measured: muscle's well, fat's with a standard deviation."""

    fat_sd: float
    reach = "a state"
    measured = np.zeros(2)
    covariance = np.eye(2)
    if_deeper = np.zeros(2)
    linear_scale = np.ones(2)

    def predict(self, outcome, instrument):
        at = np.array([outcome.values[name] for name in PARAMETERS])
        mixing = np.array([[1.0, 0.2], [0.0, 1.0]]) / np.array([[0.1], [self.fat_sd]])
        values, slopes = mixing @ (BEST / at - 1.0), mixing * (-BEST / at**2)
        by = dict(zip(PARAMETERS, slopes.T, strict=True))
        return Prediction(values, by, values, by)

    def read(self, model_values, instrument):
        return model_values


@dataclass(frozen=True)
class Compliant:
    """A leg whose fat can't be computed below a stiffness (MPa)."""

    softest: float

    def solve(self, values, sensitivities):
        return Outcome(values, (), values["superficial.C10"] >= self.softest, "too soft", 0, 0.0)


def searched(fat_sd: float, softest: float = 0.0) -> Found[Measured]:
    law = IdentifiedLaw("neo-hookean", stiffness_priors().parameters, {}, {}, starts=tuple(map(by_name, SAMPLED_AT)))
    solver = FullSolver(Compliant(softest), None, 1, Silent(), PARAMETERS)
    problem = SimpleNamespace(
        unknowns={law.name: law}, comparison=lambda law, near: Measured(fat_sd), refined=lambda search: None
    )
    (found,) = Searches(problem, solver, SEARCH).find([law.name])
    np.testing.assert_allclose(found.best.point, BEST, rtol=1e-2)
    return found


def intervals(found: Found[Measured]):
    return np.array(profile_intervals(found, np.diag([0.1, found.search.misfit.fat_sd]) ** 2))


def test_ends_are_as_lopsided_as_what_was_measured():
    """Known is 1 / C10 to 30 %: the stiffer end is farther away."""
    found = intervals(searched(0.3))
    assert found[1] == pytest.approx(BEST[1] / (1 + TIMES * np.array([0.3, -0.3])), rel=2e-2)
    muscle = np.hypot(0.1, 0.2 * 0.3)
    assert found[0] == pytest.approx(BEST[0] / (1 + TIMES * muscle * np.array([1, -1])), rel=2e-2)


def test_an_end_at_a_bound_is_open():
    found = intervals(searched(0.6))
    assert found[1, 0] == pytest.approx(BEST[1] / (1 + 0.6 * TIMES), rel=2e-2)
    assert found[1, 1] == np.inf, "any stiffer fat does"


def test_far_ends_are_solved_for():
    """The search solves half-way to them: the emulator has the rest to some per cent."""
    search = searched(1.5)
    before = len(search.trials)
    low, high = intervals(search)[1]
    assert low == pytest.approx(BEST[1] / (1 + 1.5 * TIMES), rel=5e-2) and high == np.inf
    assert len(search.trials) - before <= MOST


def test_an_end_where_the_leg_can_t_be_computed_is_open():
    low, high = intervals(searched(1.5, softest=2e-3))[1]
    assert (low, high) == (0.0, np.inf)


def test_what_is_linear_is_met_everywhere_whatever_its_sign():
    rng = np.random.default_rng(5)
    at, slope, start = rng.normal(size=(4, 2)), rng.normal(size=(2, 3)), rng.normal(size=3)
    kriging = Kriging(at, start + at @ slope, np.tile(slope, (4, 1, 1)), 1e-6)
    there = rng.normal(scale=5.0, size=(7, 2))
    np.testing.assert_allclose(kriging(there), start + there @ slope, atol=1e-8)

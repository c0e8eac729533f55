"""Intervals of a stocking's stiffnesses by profile likelihood, against closed forms."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from legfem.inverse.emulator import Kriging
from legfem.inverse.intervals import quantile
from legfem.stockings.estimates import FAR, FARTHEST, MOST, _coordinates, profile_intervals

BOUNDS = (1e-4, 0.1)
BEST = np.array([3e-3, 5e-3])
TIMES = quantile(0)


@dataclass
class Measured:
    """Compliances that are measured: muscle's well, fat's with a standard deviation."""

    fat_sd: float
    solved: list[np.ndarray] = field(default_factory=lambda: [BEST])
    softest: float = 0.0
    """Fat that can be computed, MPa."""

    def residual(self, logs):
        off = np.exp(-logs) * BEST - 1.0
        mixed = np.stack([off[..., 0] + 0.2 * off[..., 1], off[..., 1]], axis=-1)
        return mixed / np.array([0.1, self.fat_sd])

    @property
    def at(self):
        return _coordinates(np.log(self.solved))

    def compare(self, parameters):
        away = np.linalg.norm(_coordinates(np.log(parameters)) - self.at, axis=1).min()
        assert FAR < away < FARTHEST * (1 + 1e-9)
        if parameters[1] < self.softest:
            return None
        self.solved.append(parameters)
        return parameters

    def intervals(self):
        covariance = np.diag([0.1, self.fat_sd]) ** 2
        return profile_intervals(BEST, covariance, BOUNDS, lambda: self, self.compare)


def test_ends_are_as_lopsided_as_what_was_measured():
    """Known is 1 / C10 to 30 %: the stiffer end is farther away."""
    found = Measured(0.3).intervals()
    assert found[1] == pytest.approx(BEST[1] / (1 + TIMES * np.array([0.3, -0.3])), rel=1e-4)
    muscle = np.hypot(0.1, 0.2 * 0.3)
    assert found[0] == pytest.approx(BEST[0] / (1 + TIMES * muscle * np.array([1, -1])), rel=1e-4)


def test_an_end_at_a_bound_is_open():
    found = Measured(0.6).intervals()
    assert found[1, 0] == pytest.approx(BEST[1] / (1 + 0.6 * TIMES), rel=1e-4)
    assert found[1, 1] == np.inf, "any stiffer fat does"


def test_far_ends_are_solved_for():
    measured = Measured(1.5)
    low, high = measured.intervals()[1]
    assert low == pytest.approx(BEST[1] / (1 + 1.5 * TIMES), rel=1e-4) and high == np.inf
    assert 1 <= len(measured.solved) - 1 <= MOST


def test_an_end_where_the_leg_can_t_be_computed_is_open():
    low, high = Measured(1.5, softest=2e-3).intervals()[1]
    assert (low, high) == (0.0, np.inf)


def test_where_an_end_can_t_be_computed_one_nearer_to_it_does():
    measured = Measured(1.2, softest=1.7e-3)
    low, high = measured.intervals()[1]
    assert low == pytest.approx(BEST[1] / (1 + 1.2 * TIMES), rel=1e-4) and high == np.inf
    assert low < measured.softest < min(one[1] for one in measured.solved)


def test_what_is_linear_is_met_everywhere_whatever_its_sign():
    rng = np.random.default_rng(5)
    at, slope, start = rng.normal(size=(4, 2)), rng.normal(size=(2, 3)), rng.normal(size=3)
    kriging = Kriging(at, start + at @ slope, np.tile(slope, (4, 1, 1)), 1e-6)
    there = rng.normal(scale=5.0, size=(7, 2))
    np.testing.assert_allclose(kriging(there), start + there @ slope, atol=1e-8)

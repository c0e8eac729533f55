"""Moments of a normal distribution within bounds, against draws and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import truncnorm

from legfem.inverse.posterior import within

MEAN = np.array([0.3, -0.4, 1.0])
COVARIANCE = np.array([[1.0, 0.6, -0.3], [0.6, 0.8, 0.1], [-0.3, 0.1, 0.5]])
FREE = np.full(3, np.inf)


def test_bounds_far_away_change_nothing():
    mean, covariance = within(MEAN, COVARIANCE, MEAN - 20.0, FREE)
    assert mean == pytest.approx(MEAN, abs=1e-9)
    assert covariance == pytest.approx(COVARIANCE, abs=1e-9)


def test_one_bound_moves_the_others_by_their_regression_on_it():
    low = np.array([0.5, -np.inf, -np.inf])
    mean, covariance = within(MEAN, COVARIANCE, low, FREE)
    own = truncnorm((0.5 - MEAN[0]) / 1.0, np.inf, MEAN[0], 1.0)
    slope = COVARIANCE[:, 0] / COVARIANCE[0, 0]
    assert mean == pytest.approx(MEAN + slope * (own.mean() - MEAN[0]), rel=1e-6)
    left = COVARIANCE - np.outer(slope, slope) * (1.0 - own.var())
    assert covariance == pytest.approx(left, rel=1e-6)


def test_several_bounds_agree_with_draws():
    low, high = np.array([0.0, 0.0, -np.inf]), np.array([np.inf, np.inf, 0.9])
    drawn = np.random.default_rng(1).multivariate_normal(MEAN, COVARIANCE, 2_000_000)
    drawn = drawn[np.all((drawn > low) & (drawn < high), axis=1)]
    mean, covariance = within(MEAN, COVARIANCE, low, high)
    # Three bounds at once are matched in moments only: within 4 % of the widths.
    sd = drawn.std(axis=0)
    assert mean == pytest.approx(drawn.mean(axis=0), abs=0.04 * sd.max())
    assert np.sqrt(np.diag(covariance)) == pytest.approx(sd, rel=0.05)


@pytest.mark.parametrize("away", [10.0, 19.9, 20.1, 300.0])
@pytest.mark.parametrize("side", [1, -1])
def test_far_beyond_a_bound_what_is_left_clings_to_it(away, side):
    ends = (np.array([away]), np.array([np.inf])) if side > 0 else (np.array([-np.inf]), np.array([-away]))
    mean, covariance = within(np.zeros(1), np.eye(1), *ends)
    beyond = side * mean[0] - away
    # An exponential of rate a, to the next order of Mills' ratio.
    assert beyond == pytest.approx(1 / away, rel=3 / away**2)
    assert np.sqrt(covariance[0, 0]) == pytest.approx(1 / away, rel=4 / away**2)

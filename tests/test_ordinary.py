"""The base model by equal weights, where the errors' weights would take it far from the data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making_diagnosis import TRUTH, one_at_each_rate, problem_of, ramps
from scipy.optimize import least_squares

from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.diagnose import ordinary_explanation
from legfem.inverse.explain import explain
from legfem.inverse.map_fit import fit, ordinary_fit


def with_unknown_outlines(problem):
    """Add five effects of 1 % of the force that the leg's outlines may have."""
    d, force = problem.predictor.observed.displacement, problem.predictor.observed.force
    known = np.column_stack([0.01 * force * np.cos(k * np.pi * d / 20) for k in range(5)])
    return replace(problem, errors=replace(problem.errors, known=known))


def distance(residual):
    return float(np.sqrt(np.mean(residual**2)))


@pytest.mark.parametrize(
    ("effects", "recordings"),
    [
        (
            {"viscoelasticity.ratio": 0.5, "viscoelasticity.relaxation_time": 8.0, "viscoelasticity.spread": 1.0},
            one_at_each_rate,
        ),
        (
            {
                "muscle-contraction.stiffening": 0.3,
                "muscle-contraction.onset": 0.5,
                "muscle-contraction.rise": 0.08,
                "muscle-contraction.away": 2.0,
            },
            ramps,
        ),
    ],
)
def test_a_wrong_model_stays_near_the_data(effects, recordings):
    problem = with_unknown_outlines(problem_of(recordings(), effects, seed=7)[0])
    found = ordinary_fit(problem, [TRUTH])

    def residual(logs):
        values = {**found.values, DEEP_C10: np.exp(logs[0]), DEEP_C20: np.exp(logs[1])}
        return problem.predictor.observed.force - problem.predictor(values, ())

    best = least_squares(residual, np.log([found.values[DEEP_C10], found.values[DEEP_C20]])).fun
    assert distance(found.residual) < 1.02 * distance(best)
    weighed = fit(problem, (), found.values)
    assert distance(weighed.residual) > 3 * distance(best), "nothing is to be guarded against"


def test_a_right_model_has_the_same_stiffness_and_an_interval_that_holds_the_truth():
    held = 0
    for seed in range(12):
        problem, base = problem_of(ramps(), seed=seed)
        found = ordinary_fit(problem, [TRUTH])
        assert found.values[DEEP_C10] == pytest.approx(base.values[DEEP_C10], rel=0.05)
        shown = ordinary_explanation(problem, found, explain(base, []).base)
        low, high = shown.interval(DEEP_C10)
        held += low <= TRUTH[DEEP_C10] <= high
    assert held >= 10

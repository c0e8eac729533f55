"""Where a misfit sits and what it looks like: score tests and windows."""

from __future__ import annotations

import numpy as np
import pytest
from making_diagnosis import problem_of, ramps
from scipy.stats import kstest

from legfem.inverse import location
from legfem.inverse.location import score_tests
from legfem.mechanisms import mechanism_named

SOUGHT = [mechanism_named(name) for name in ("contact-onset", "force-drift", "preconditioning", "support-compliance")]


def test_p_values_without_effect_are_uniform():
    p_values = []
    for seed in range(50):
        _, base = problem_of(ramps(), seed=seed)
        p_values.append(score_tests(base, SOUGHT, seed).p_value)
    assert kstest(p_values, "uniform").pvalue > 0.01


def test_a_local_error_is_found_where_it_is():
    observed = problem_of(ramps())[0].predictor.observed
    bump = 0.15 * ((observed.displacement > 9) & (observed.displacement < 11))
    _, base = problem_of(ramps(), seed=4, extra=bump)
    windows = score_tests(base, SOUGHT).windows
    edges = [edge for w in windows for edge in w.displacement]
    assert min(abs(edge - 9.0) for edge in edges) < 0.5
    assert windows[0].p_value < 0.01


@pytest.mark.parametrize(
    "effects",
    [
        {"contact-onset.offset": 0.2},
        {"support-compliance.compliance": 0.06},
        {"preconditioning.softening": 0.12},
        {"force-drift.rate": 0.04},
    ],
)
def test_a_small_effect_s_sign_is_among_the_strongest(effects):
    """First contact is stated: an onset in all trials isn't hidden by a parameter of each."""
    _, base = problem_of(ramps(), effects, seed=3)
    found = score_tests(base, SOUGHT)
    name = next(iter(effects)).split(".")[0]
    assert found.score(name).p_value < 0.05
    assert found.p_value < 0.05
    strongest = max(found.scores, key=lambda s: s.statistic)
    assert found.score(name).statistic > 0.5 * strongest.statistic
    for score in found.scores:
        assert 0.0 <= score.concealed < 1.0
    assert {s.name for s in found.scores} == {m.name for m in SOUGHT}
    assert found.score("levitation") is None


def test_the_same_draws_give_the_same_p_values():
    _, base = problem_of(ramps(), seed=4)
    one, other = (score_tests(base, SOUGHT[:2], 3) for _ in range(2))
    assert one.p_value == other.p_value
    assert one.p_value == pytest.approx(score_tests(base, SOUGHT[:2], 4).p_value, abs=0.15)


def test_first_contacts_of_trials_driven_alike_count_once_in_the_lack_of_fit():
    """Of forty means C10, C20 and one first contact take three degrees of freedom: three of them move one mean."""
    problem, base = problem_of(ramps(), seed=4)
    drawn = problem.errors.draw(1000, np.random.default_rng(1))
    squares = location._lack_of_fit(base, drawn)
    freedom = len(problem.predictor.observed.means) - 3
    assert squares.mean() == pytest.approx(freedom, abs=4 * np.sqrt(2 * freedom / 1000))

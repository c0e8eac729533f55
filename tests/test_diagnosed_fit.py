"""The models of a diagnosis as results of fits, and what each trial says by itself."""

from dataclasses import replace

import numpy as np
import pytest
from making_diagnosed import BASE, diagnosed, diagnosed_of
from making_diagnosis import MADE, noisy, observations, ramps

from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.diagnose import Identified
from legfem.inverse.predictor import onset_name
from legfem.inverse.station_test import FittedStations


@pytest.fixture(scope="module")
def consistent():
    """A diagnosis of recordings of the base model."""
    return diagnosed({}, asked=("support-compliance",))


def test_the_base_model_is_a_fit_of_the_same_numbers(consistent):
    base = consistent.base
    assert base.subject is MADE and base.law == consistent.law and base.log.seed == 0
    assert base.estimates[DEEP_C10].value == consistent.base_model.value(DEEP_C10)
    assert base.estimates[DEEP_C10].ci95 == consistent.base_model.interval(DEEP_C10)
    assert base.values == consistent.base_model.fit.values
    assert [one.name for one in base.tests] == list(consistent.observed.trials)
    measured = np.concatenate([one.force.channel.values for one in base.tests])
    np.testing.assert_array_equal(measured, consistent.observed.force)
    left = np.concatenate([one.force.residual for one in base.tests])
    np.testing.assert_allclose(left, -consistent.base_model.fit.residual)
    assert base.cost.value == pytest.approx(left @ left)
    assert np.diag(base.correlations) == pytest.approx(1.0)


def test_the_best_model_has_its_stiffness_over_all_explanations(consistent):
    best = consistent.best_fit
    assert best.estimates[DEEP_C10].ci95 == consistent.intervals[DEEP_C10]


def test_trials_of_one_stiffness_agree(consistent):
    base = consistent.base
    assert base.agreement.fits and base.agreement.degrees_of_freedom == 2
    for one in base.tests:
        own = one.by_itself[DEEP_C10]
        assert abs(own.value - BASE[DEEP_C10]) < 3 * own.standard_error


def test_a_trial_that_is_stiffer_asks_for_more_by_itself():
    observed, predictor = observations(list(ramps()))
    force = predictor(BASE, ())
    force = np.where(observed.trial == 0, 1.15, 1.0) * force
    found = diagnosed_of(noisy(observed, force, 2), asked=("support-compliance",))
    base = found.base
    first, *others = [one.by_itself[DEEP_C10] for one in base.tests]
    assert base.agreement.p_value < 1e-3
    assert first.departure > 3 and first.value > max(one.value for one in others) * 1.1


def test_one_trial_says_nothing_by_itself():
    observed, predictor = observations(list(ramps())[:1])
    found = diagnosed_of(noisy(observed, predictor(BASE, ()), 2), asked=("support-compliance",))
    base = found.base
    assert base.agreement.degrees_of_freedom == 0 and not base.tests[0].by_itself


def test_what_is_set_aside_counts_for_no_trial(consistent):
    problem = consistent.weighted_base.problem
    aside = problem.predictor.observed.trial == 1
    base = consistent.weighted_base
    model = replace(base, fit=replace(base.fit, problem=problem.setting_aside(aside)))
    base = replace(consistent, base_model=model, explained=replace(consistent.explained, base=model)).base
    assert [one.fitted for one in base.tests] == [True, False, True]


@pytest.mark.parametrize("weighting", ["covariance", "equal"])
def test_a_diagnosis_begins_from_what_was_identified(consistent, weighting):
    """The base model has the numbers of the identification, and predicts there what that did."""
    observed, before = consistent.observed, consistent.base_model.fit
    values = {**before.values, DEEP_C10: 1.004 * before.values[DEEP_C10]}
    estimates = {
        name: replace(one, value=values[name], standard_error=1.1 * one.standard_error)
        for name, one in consistent.base.estimates.items()
    }
    known = replace(consistent.base, values=values, estimates=estimates, weighting=weighting)
    contacts = np.array([values[onset_name(k)] for k in range(len(observed.trials))])
    stations = FittedStations(contacts, {"force": 1.001 * before.prediction})
    found = diagnosed_of(observed, asked=("support-compliance",), identified=Identified(known, stations))
    assert found.equally == (weighting == "equal") and found.verdict == "consistent"
    assert found.base.estimates == estimates and found.base.weighting == weighting
    assert [one.name for one in found.base.tests] == list(observed.trials)
    shown = found.base_model
    assert shown.value(DEEP_C10) == values[DEEP_C10] and shown.interval(DEEP_C10) == estimates[DEEP_C10].ci95
    assert shown.fit.values[DEEP_C10] == pytest.approx(values[DEEP_C10], rel=1e-9)
    np.testing.assert_allclose(shown.fit.prediction, 1.001 * before.prediction, rtol=1e-9)
    assert 0.0 < found.emulator_error < 0.02
    low, high = found.intervals[DEEP_C10]
    assert low < values[DEEP_C10] < high

"""What is doubted of a diagnosed leg and its recordings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making import write_subject
from making_diagnosed import BASE, diagnosed, diagnosed_of
from making_diagnosis import INSTRUMENT, noisy, observations, ramps

from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.trial_noise import estimate_noise
from legfem.legs.diagnosis import doubts_of
from legfem.legs.loading import load_subject


@pytest.fixture(scope="module")
def subject(tmp_path_factory):
    folder = write_subject(tmp_path_factory.mktemp("doubts") / "made")
    return replace(load_subject(folder, need_recordings=False), instrument=INSTRUMENT)


@pytest.fixture(scope="module")
def usual():
    return diagnosed({}, asked=[])


def test_a_stiffness_that_few_people_have_is_doubted_with_the_unit_that_explains_it(usual, subject):
    assert not doubts_of(usual, subject)

    base = usual.base_model
    k, mean = base.fit.free.index(DEEP_C10), base.posterior.mean.copy()
    mean[k] = base.fit.parameters[k].prior.departure(9.0)
    stiff = replace(base, posterior=replace(base.posterior, mean=mean), probability=1.0)
    explained = replace(usual.explained, every=(stiff,), base=stiff)
    told = [str(doubt) for doubt in doubts_of(replace(usual, explained=explained, base_model=stiff), subject)]
    assert len(told) == 1 and "stiffer than in 99 of 100 people" in told[0]


@pytest.mark.parametrize(("ripple", "doubted"), [(0.0, False), (0.02, False), (0.2, True)])
def test_repeats_that_differ_by_more_than_the_data_sheet_says_are_doubted(ripple, doubted, subject):
    observed, predictor = observations(list(ramps()))
    phase = 2 * np.pi * observed.displacement / 3.0 + 2.0 * observed.trial
    force = predictor({**BASE}, ()) + ripple * np.sin(phase)
    found = diagnosed_of(noisy(observed, force, 4), asked=[])
    told = [doubt for doubt in doubts_of(found, subject) if "trials differ" in doubt.problem]
    assert bool(told) is doubted
    assert (found.verdict == "consistent") is not doubted, "it isn't taken for noise"


def test_a_leg_that_moves_otherwise_in_each_trial_is_doubted(usual, subject):
    problem = usual.weighted_base.problem
    noise = replace(problem.errors.noise, beyond_way=0.3)
    noisy = replace(problem, errors=replace(problem.errors, noise=noise))
    base = replace(usual.weighted_base, fit=replace(usual.weighted_base.fit, problem=noisy))
    moved = replace(usual, explained=replace(usual.explained, base=base))
    told = [doubt.field for doubt in doubts_of(moved, subject)]
    assert told == ["displacement_mm"]
    of_a_specimen = doubts_of(moved, object())
    assert [doubt.field for doubt in of_a_specimen] == ["displacement_mm"]


def test_where_no_accuracy_is_stated_all_that_repeats_differ_by_is_noise():
    observed, predictor = observations(list(ramps()))
    phase = 2 * np.pi * observed.displacement / 3.0 + 2.0 * observed.trial
    seen = noisy(observed, predictor(BASE, ()) + 0.2 * np.sin(phase), 4)
    stated, unstated = (estimate_noise(seen, replace(INSTRUMENT, stated=stated), 12.0) for stated in (True, False))
    assert stated.beyond_force + stated.beyond_way > 0
    assert unstated.beyond_force == unstated.beyond_way == 0
    assert np.hypot(unstated.slow_sd, unstated.wander_sd) > np.hypot(stated.slow_sd, stated.wander_sd)


def test_an_instrument_far_better_than_a_leg_is_at_rest_is_no_reason_to_doubt(subject):
    observed, predictor = observations(list(ramps()))
    fine = replace(INSTRUMENT, displacement_sd=5e-4)
    moved = 0.03 * np.sin(2 * np.pi * observed.displacement / 7.0 + 2.0 * observed.trial)
    seen = noisy(observed, predictor(BASE, ()) + observed.stiffness * moved, 4)
    noise = estimate_noise(seen, fine, 12.0)
    assert noise.beyond_way == noise.beyond_force == 0

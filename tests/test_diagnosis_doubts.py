"""What is doubted of a diagnosed leg and its recordings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making import write_subject
from making_diagnosed import BASE, diagnosed, diagnosed_of
from making_diagnosis import INSTRUMENT, noisy, observations, ramps

from legfem.diagnose.doubts import doubts_of
from legfem.subjects.loading import load_subject


@pytest.fixture(scope="module")
def subject(tmp_path_factory):
    folder = write_subject(tmp_path_factory.mktemp("doubts") / "made")
    return replace(load_subject(folder, need_recordings=False), instrument=INSTRUMENT)


@pytest.fixture(scope="module")
def usual():
    return diagnosed({}, asked=[])


def test_a_stiffness_that_few_people_have_is_doubted_with_the_unit_that_explains_it(usual, subject):
    assert not doubts_of(usual, subject)

    base = usual.base
    k, mean = base.fit.free.index("C10"), base.posterior.mean.copy()
    mean[k] = base.fit.parameters[k].prior.departure(9.0)
    stiff = replace(base, posterior=replace(base.posterior, mean=mean), probability=1.0)
    explained = replace(usual.explained, every=(stiff,), base=stiff)
    told = [str(doubt) for doubt in doubts_of(replace(usual, explained=explained), subject)]
    assert len(told) == 1 and "stiffer than in 99 of 100 people" in told[0]


@pytest.mark.parametrize(("ripple", "doubted"), [(0.0, False), (0.02, False), (0.2, True)])
def test_repeats_that_differ_by_more_than_the_data_sheet_says_are_doubted(ripple, doubted, subject):
    observed, predictor = observations(list(ramps()))
    phase = 2 * np.pi * observed.displacement / 3.0 + 2.0 * observed.trial
    force = predictor({**BASE}, ()) + ripple * np.sin(phase)
    found = diagnosed_of(noisy(observed, force, 4), asked=[])
    told = [doubt for doubt in doubts_of(found, subject) if "trials differ" in doubt.problem]
    assert bool(told) is doubted
    unstated = replace(subject, instrument=replace(INSTRUMENT, stated=False))
    assert not any("trials differ" in doubt.problem for doubt in doubts_of(found, unstated))


def test_a_leg_that_moves_otherwise_in_each_trial_is_doubted(usual, subject):
    noise = usual.errors.noise
    problem = usual.alone.problem
    for wander, fields in ((2.0, []), (6.0, ["displacement_mm"])):
        size = wander * INSTRUMENT.wander_sd(usual.observed.jitter_sd)
        errors = replace(problem.errors, noise=replace(noise, wander_sd=size))
        base = replace(usual.alone, problem=problem.with_errors(errors))
        moved = replace(usual, explained=replace(usual.explained, base=base))
        told = [doubt for doubt in doubts_of(moved, subject) if "trials differ" in doubt.problem]
        assert [doubt.field for doubt in told] == fields

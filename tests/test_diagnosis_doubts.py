"""What is doubted of a diagnosed leg and its recordings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making import write_subject
from making_diagnosed import BASE, diagnosed, diagnosed_of
from making_diagnosis import INSTRUMENT, force_at, noisy, observations, ramps

from legfem.common.numbers import share
from legfem.common.units import FloatArray
from legfem.data import Recording
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.map_fit import fit
from legfem.inverse.observations import Observations, observe
from legfem.inverse.trial_noise import estimate_noise, trial_covariance
from legfem.legs.diagnosis import doubts_of
from legfem.legs.loading import load_subject
from legfem.legs.plausibility import doubts_about
from legfem.report.diagnosis import diagnosis_web_page
from legfem.report.diagnosis_headline import headline
from legfem.solve.protocol import Protocol


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


def rippled(observed: Observations, force: FloatArray, size: float) -> Observations:
    """Return observations whose drive ripples by so much (mm), otherwise in every trial."""
    moved = size * np.sin(2 * np.pi * observed.displacement / 7.0 + 2.0 * observed.trial)
    return noisy(observed, force + observed.with_force(force).stiffness * moved, 4)


def test_a_ripple_that_moves_c10_by_less_than_its_interval_stands_below_with_its_size(subject):
    observed, predictor = observations(list(ramps()))
    found = diagnosed_of(rippled(observed, predictor(BASE, ()), 0.06), asked=("force-drift",))
    (doubt,) = doubts_of(found, subject)
    assert 0.0 < doubt.effect_on_C10 < found.may_be_off
    assert f"moves C10 by {share(doubt.effect_on_C10)} at most" in doubt.problem
    page = diagnosis_web_page(found, subject)
    assert "doubtful" not in f"{page.headline.said} {dict(page.headline.answers)}".lower()
    assert any("DOUBTFUL INPUT" in line and "trials differ slowly" in line for line in page.warnings)


def test_a_ripple_that_moves_c10_by_more_leads(usual, subject):
    problem = usual.weighted_base.problem
    for size, leads in ((0.06, False), (0.6, True)):
        noise = replace(problem.errors.noise, beyond_way=size)
        made = replace(problem, errors=replace(problem.errors, noise=noise))
        base = replace(usual.weighted_base, fit=replace(usual.weighted_base.fit, problem=made))
        moved = replace(usual, explained=replace(usual.explained, base=base), base_model=base)
        (doubt,) = doubts_of(moved, subject)
        assert (doubt.effect_on_C10 > moved.may_be_off) is leads
        heading = diagnosis_web_page(moved, subject).headline.shown_heading
        assert heading.startswith("Check the doubtful input first") is leads


def test_what_moves_c10_is_the_errors_own_fit(usual):
    """Drawn errors, each fitted by itself, move C10 as far."""
    base, observed = usual.weighted_base, usual.observed
    covariance = trial_covariance(observed, replace(usual.errors.noise, wander_sd=0.1, slow_sd=0.0))
    draws = np.random.default_rng(3).multivariate_normal(np.zeros(len(observed.force)), covariance, 60)
    values = []
    for error in draws:
        force = base.fit.prediction + error
        seen = replace(base.problem, predictor=replace(base.problem.predictor, observed=observed.with_force(force)))
        values.append(fit(seen, (), base.fit.values).values[DEEP_C10] / base.fit.values[DEEP_C10])
    assert base.moved_by(covariance, DEEP_C10) == pytest.approx(1.96 * np.std(values), rel=0.25)


def slipped(trial: int, rise: float) -> Recording:
    """Return a slow press with a hold, whose force changes by a share at 30 s: as where an indenter slips."""
    protocol = Protocol.cycle(20.0, 0.4, hold=60.0)
    time = np.arange(0, protocol.duration + 1e-9, 0.1)
    d = protocol.displacement_at(time)
    noise = np.random.default_rng(trial).normal(size=(2, len(time)))
    since = 1.0 / (1.0 + np.exp(-np.clip((time - 30.0) / 0.1, -50.0, 50.0)))
    force = force_at(BASE[DEEP_C10], BASE[DEEP_C20], d) * (1.0 + rise * since) + 0.02 * noise[0]
    return Recording(time, d + 0.003 * noise[1], force, f"trial{trial}")


def test_a_trial_whose_part_is_set_aside_is_not_doubted_as_well(subject):
    given = tuple(slipped(trial, -0.4 * (trial == 2)) for trial in (1, 2, 3))
    leg = replace(subject, recordings=given, starts_at_contact=True, confirmed=())
    found = diagnosed_of(observe(leg.trials), ("force-drift", "muscle-contraction"))
    assert found.aside is not None and found.aside.described == "trial2, loading"
    before = [doubt for doubt in doubts_about(leg) if doubt.source == "trial2"]
    assert any("drops by" in doubt.problem for doubt in before)
    assert not [doubt for doubt in doubts_of(found, leg) if "trial2" in doubt.source]
    assert (
        "as a muscle that tenses or a leg that moves, disturbed" in dict(headline(found, ()).answers)["Problems found"]
    )


def test_where_no_accuracy_is_stated_all_that_repeats_differ_by_is_noise():
    observed, predictor = observations(list(ramps()))
    phase = 2 * np.pi * observed.displacement / 3.0 + 2.0 * observed.trial
    seen = noisy(observed, predictor(BASE, ()) + 0.2 * np.sin(phase), 4)
    stated, unstated = (estimate_noise(seen, replace(INSTRUMENT, stated=stated)) for stated in (True, False))
    assert stated.beyond_force + stated.beyond_way > 0
    assert unstated.beyond_force == unstated.beyond_way == 0
    assert np.hypot(unstated.slow_sd, unstated.wander_sd) > np.hypot(stated.slow_sd, stated.wander_sd)


def test_an_instrument_far_better_than_a_leg_is_at_rest_is_no_reason_to_doubt(subject):
    observed, predictor = observations(list(ramps()))
    fine = replace(INSTRUMENT, displacement_sd=5e-4)
    noise = estimate_noise(rippled(observed, predictor(BASE, ()), 0.03), fine)
    assert noise.beyond_way == noise.beyond_force == 0

"""A part of a trial that something unknown touched is set aside, and a misfit that is small is graded by its size."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from making_diagnosed import diagnosed_of
from making_diagnosis import noisy, observations, two_rates

from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.location import touched_part
from legfem.inverse.predictive import Misfit, misfit_of
from legfem.report.diagnosis_headline import headline

BASE = {DEEP_C10: 0.001, DEEP_C20: 0.0006}
ASKED = ("preconditioning", "force-drift", "muscle-contraction", "superficial-stiffness")


def recorded(stiffer=0.0, after=20.0, trial=1, seed=1, bump=0.0):
    """Return three slow trials with holds; in one a muscle tenses for good, so many seconds into the hold."""
    observed, predictor = observations([one for one in two_rates() if "rate0.4" in one.trial])
    force = predictor(BASE, [])
    begun = observed.time[observed.phase == "hold"].min() + after
    tense = (observed.trial == trial) / (1 + np.exp(-np.clip(observed.time - begun, -50, 50)))
    force = force * (1 + stiffer * tense)
    force = force + bump * np.sin(observed.displacement / 1.5) * (observed.displacement > 3.0)
    return noisy(observed, force, seed)


@cache
def with_tensed(trial, after):
    """Of three trials, in one of which a muscle tenses."""
    return diagnosed_of(recorded(0.15, after, trial), ASKED)


@pytest.mark.parametrize(
    ("trial", "after"), [(1, 20.0), *(pytest.param(*one, marks=pytest.mark.slow) for one in ((0, 5.0), (2, 40.0)))]
)
def test_a_muscle_that_tenses_in_one_hold_is_set_aside_and_the_rest_gives_c10(trial, after):
    found = with_tensed(trial, after)
    assert found.aside is not None
    assert found.aside.trial == found.observed.trials[trial] and found.aside.phases == ("hold", "unloading")
    low, high = found.intervals[DEEP_C10]
    assert low < BASE[DEEP_C10] < high
    assert found.best.value(DEEP_C10) == pytest.approx(BASE[DEEP_C10], rel=0.05)
    answer = headline(found, ())
    assert found.aside.described in answer.heading
    assert found.aside.described in dict(answer.answers)["Problems found"]


def test_of_two_trials_that_differ_in_the_hold_both_holds_are_set_aside():
    """Nobody knows which of them is sound; what they did before and after gives C10."""
    observed, predictor = observations([one for one in two_rates() if "rate0.4" in one.trial][:2])
    hold = observed.time[observed.phase == "hold"].min()
    twitch = np.exp(-0.5 * ((observed.time - hold - 25.0) / 8.0) ** 2) * (observed.trial == 1)
    found = diagnosed_of(noisy(observed, predictor(BASE, []) * (1 + 0.15 * twitch), 1), ASKED)
    assert found.aside is not None
    assert found.aside.described == " and ".join(observed.trials) + ", hold"
    low, high = found.intervals[DEEP_C10]
    assert low < BASE[DEEP_C10] < high
    assert found.best.value(DEEP_C10) == pytest.approx(BASE[DEEP_C10], rel=0.05)
    assert touched_part(noisy(observed, predictor(BASE, []), 1), found.errors) is None


def tensed(drawn):
    """Return a share of force that one of three trials has more: from any time in the hold on, tiring, or a twitch."""
    observed, predictor = observations([one for one in two_rates() if "rate0.4" in one.trial])
    time, hold = observed.time, observed.time[observed.phase == "hold"]
    size, rise = np.exp(drawn.uniform(np.log([0.04, 0.3]), np.log([0.4, 6.0])))
    begun, course = drawn.uniform(hold.min(), hold.max() - 3.0), drawn.integers(3)
    more = 1 / (1 + np.exp(-np.clip((time - begun) / rise, -50, 50)))
    if course == 1:
        more = more * np.exp(-np.clip(time - begun, 0.0, None) / drawn.uniform(10.0, 60.0))
    if course == 2:
        more = np.exp(-0.5 * ((time - begun) / drawn.uniform(1.0, 8.0)) ** 2)
    gains = 1 + np.exp(drawn.uniform(np.log(0.003), np.log(0.02))) * drawn.normal(size=3)
    touched = 1 + size * more * (observed.trial == drawn.integers(3))
    return noisy(observed, predictor(BASE, []) * touched * gains[observed.trial], int(drawn.integers(1_000_000)))


@pytest.mark.slow
def test_c10_is_that_of_the_rest_in_nine_of_ten_draws_of_any_time_size_and_course():
    drawn = np.random.default_rng(5)
    off = []
    for _ in range(24):
        found = diagnosed_of(tensed(drawn), ASKED)
        off.append(np.inf if found.withheld else found.best.value(DEEP_C10) / BASE[DEEP_C10] - 1)
    right = sum(abs(one) < 0.05 for one in off)
    print(f"C10 within 5 % in {right} of {len(off)}: {np.round(off, 3)}")
    assert right >= 0.9 * len(off)


def test_the_rest_has_an_interval_of_its_own_which_is_wider():
    whole = diagnosed_of(recorded(), ASKED)
    rest = with_tensed(1, 20.0)
    assert whole.aside is None
    ratio = np.diff(rest.intervals[DEEP_C10])[0] / np.diff(whole.intervals[DEEP_C10])[0]
    assert 1.0 < ratio < 2.0


def test_trials_that_differ_by_their_gain_and_noise_alone_are_not_set_aside():
    errors = diagnosed_of(recorded(), ASKED[:1]).errors
    for seed in (1, 2, 3):
        observed = recorded(seed=seed)
        gains = 1 + 0.03 * np.random.default_rng(seed).normal(size=3)
        assert touched_part(observed.with_force(observed.force * gains[observed.trial]), errors) is None


def test_of_two_trials_a_part_is_set_aside_in_both_and_all_of_them_never():
    """From the hold on; and where the whole of one departs from the other, beside which nothing would be left."""
    observed, predictor = observations([one for one in two_rates(2) if "rate0.4" in one.trial])
    second = observed.trial == 1
    later, everywhere = second & (observed.phase != "loading"), second * np.sin(observed.time / 4.0)
    for touched, described in ((later, "hold and unloading"), (everywhere, None)):
        parted = noisy(observed, predictor(BASE, []) * (1 + 0.2 * touched), 1)
        found = touched_part(parted, diagnosed_of(parted, ASKED[:1]).errors)
        assert (found is None) == (described is None)
        assert found is None or found.described == f"{' and '.join(observed.trials)}, {described}"


@pytest.fixture(scope="module")
def small_misfit():
    return diagnosed_of(recorded(bump=0.2), ASKED)


def test_a_misfit_below_a_hundredth_of_the_force_that_hardly_moves_c10_is_good_enough(small_misfit):
    found = small_misfit
    assert found.verdict == "unexplained" and found.misfit.size < 0.01
    assert not found.withheld
    answer = headline(found, ())
    assert answer.heading.startswith("Good enough: the model misses by 0.")
    assert answer.sentence.startswith("Report")
    assert "good enough" in dict(answer.answers)["Problems found"]
    low, high = found.intervals[DEEP_C10]
    assert low < BASE[DEEP_C10] < high


def test_by_errors_as_large_as_what_nothing_explains_nothing_is_missing_and_C10_is_less_certain(small_misfit):
    assert small_misfit.tolerant.adequacy > 0.99 > small_misfit.explained.adequacy
    (low, high), ends = small_misfit.own_intervals[DEEP_C10], small_misfit.interval_as_seen
    assert high - low > ends[1] - ends[0]


def test_a_misfit_that_is_not_small_gives_a_range_alone(small_misfit):
    found = replace(small_misfit, misfit=Misfit(0.02, small_misfit.misfit.moves))
    assert not found.withheld and found.intervals == small_misfit.intervals
    answer = headline(found, ())
    assert answer.heading == "The model misses by 2 % of the largest force, and nothing explains it."
    assert answer.sentence.startswith("Report a range")
    assert "good enough" not in dict(answer.answers)["Problems found"]
    assert dict(answer.answers)["What to do"].startswith("Use the range.")


def test_a_misfit_that_is_large_or_moves_c10_far_gives_no_number(small_misfit):
    found = small_misfit
    large = replace(found, misfit=Misfit(0.06, found.misfit.moves))
    moving = replace(found, misfit=Misfit(found.misfit.size, 0.9))
    for one in (large, moving):
        assert one.withheld
        assert headline(one, ()).heading == "No."


def test_a_misfits_size_is_that_of_what_is_left_over_the_largest_force(small_misfit):
    found = small_misfit
    assert found.equally
    left = found.base_model.fit.residual
    expected = np.sqrt(np.mean(left**2)) / found.observed.force.max()
    assert misfit_of(found.explained.base.problem, found.base_model.fit).size == pytest.approx(expected)

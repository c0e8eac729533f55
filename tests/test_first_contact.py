"""Whole diagnoses of recordings as labs make them: air before the skin, gains, nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from making_diagnosed import diagnosed_of
from making_diagnosis import INSTRUMENT, TRUTH, pressed

from legfem.data import segment_all
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.observations import observe
from legfem.inverse.predictor import onset_name
from legfem.inverse.verdict import Diagnosis

SOUGHT = ("preconditioning", "support-compliance", "force-drift", "fascia-stiffness")


def of(recordings, asked=SOUGHT) -> Diagnosis:
    return diagnosed_of(observe(segment_all(recordings, INSTRUMENT)), asked)


def found_air(found: Diagnosis, trial: int) -> tuple[float, float, float]:
    """Return where a trial was touched, and its 95 % interval; mm."""
    at = found.observed.contacts[trial].displacement
    low, high = found.base_model.interval(onset_name(trial))
    return at + found.base_model.value(onset_name(trial)), at + low, at + high


def test_first_contact_is_fitted_and_so_is_the_stiffness():
    inside, near, stiffness = [], [], []
    for seed in range(5):
        airs = np.random.default_rng(seed + 50).uniform(0.0, 3.0, 3)
        found = of(pressed(airs, seed=seed), asked=())
        for k, air in enumerate(airs):
            value, low, high = found_air(found, k)
            inside.append(low <= air <= high)
            near.append(abs(value - air))
        low, high = found.intervals[DEEP_C10]
        stiffness.append(low <= TRUTH[DEEP_C10] <= high)
        assert found.base_model.value(DEEP_C10) == pytest.approx(TRUTH[DEEP_C10], rel=0.03)
        assert len(found.observed.protocols) == 1, "trials with other air are repeats"
    assert np.mean(inside) > 0.85
    assert np.mean(stiffness) > 0.7
    assert np.max(near) < 0.15


def test_one_onset_late_in_detection_does_not_spoil_the_others():
    """A first trial that begins at the skin, beside two in air."""
    airs = (0.0, 2.2, 1.1)
    found = of(pressed(airs, seed=3))
    assert found.verdict == "consistent"
    for k, air in enumerate(airs):
        value, low, high = found_air(found, k)
        assert value == pytest.approx(air, abs=0.12)
        assert high - low < 0.5


@pytest.mark.parametrize("scatter", [pytest.param(0.01, marks=pytest.mark.slow), 0.03])
def test_gains_of_trials_and_nothing_else_get_no_name(scatter):
    for seed in range(2):
        generator = np.random.default_rng(seed + 10)
        gains = generator.normal(0.0, scatter, 3)
        zeros = generator.normal(0.0, 0.02, 3)
        found = of(pressed((0.0, 0.0, 0.0), list(gains), seed, list(zeros)))
        assert found.verdict == "consistent"
        low, high = found.intervals[DEEP_C10]
        # Gains that all trials share aren't told from the stiffness.
        assert low <= TRUTH[DEEP_C10] * (1 + gains.mean()) <= high


@pytest.mark.slow
@pytest.mark.parametrize("scatter", [0.01, 0.02, 0.03])
def test_of_thirty_draws_of_gains_nearly_all_are_consistent(scatter):
    verdicts, held = [], []
    for seed in range(30):
        gains = np.random.default_rng(seed + 1000).normal(0.0, scatter, 3)
        found = of(pressed((0.0, 0.0, 0.0), list(gains), seed), asked=None)
        verdicts.append(found.verdict)
        low, high = found.intervals[DEEP_C10]
        held.append(low <= TRUTH[DEEP_C10] <= high)
    assert verdicts.count("consistent") >= 28
    assert sum(held) >= 26


@pytest.mark.slow
def test_of_thirty_draws_of_air_nearly_all_are_consistent():
    verdicts, held, inside = [], [], []
    for seed in range(30):
        airs = np.random.default_rng(seed + 2000).uniform(0.0, 3.0, 3)
        found = of(pressed(airs, seed=seed), asked=None)
        verdicts.append(found.verdict)
        low, high = found.intervals[DEEP_C10]
        held.append(low <= TRUTH[DEEP_C10] <= high)
        inside += [found_air(found, k)[1] <= air <= found_air(found, k)[2] for k, air in enumerate(airs)]
    assert verdicts.count("consistent") >= 28
    assert sum(held) >= 26
    assert np.mean(inside) > 0.88


def test_a_first_trial_that_is_stiffer_is_named_beyond_gains():
    """15.5 % at touch and 9.5 % at full depth, which is more than trials scatter."""
    recordings = pressed((0.0, 0.4, 0.8), seed=5)
    first = recordings[0]
    share = 0.155 - 0.06 * first.displacement / 20.0
    stiffer = type(first)(first.time, first.displacement, first.force * (1 + share), first.trial)
    found = of([stiffer, *recordings[1:]])
    assert found.verdict in ("named", "ambiguous")
    assert found.models[0].names == ("preconditioning",)
    low, high = found.intervals[DEEP_C10]
    assert low <= TRUTH[DEEP_C10] <= high
    assert found.models[0].value(DEEP_C10) == pytest.approx(TRUTH[DEEP_C10], rel=0.03)

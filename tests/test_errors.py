"""What recordings err by: drawn, whitened, estimated from repeats."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making_diagnosis import INSTRUMENT, NOISE, noisy, observations, ramps, two_rates
from test_observations import observed as recorded

from legfem.data import Instrument
from legfem.inverse.accuracy import Cause
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.errors import COMMON_GAIN_SD, NuisanceEffect, error_model
from legfem.inverse.intervals import NUMERICAL_ERROR
from legfem.inverse.trial_noise import USUAL_AT_REST, estimate_noise, trial_covariance
from legfem.solve.protocol import Protocol

TRUTH = {DEEP_C10: 1e-3, DEEP_C20: 0.8e-3}


@pytest.fixture(scope="module")
def seen():
    """Three slow loadings without errors, and the force."""
    observed, predictor = observations(ramps())
    force = predictor(TRUTH)
    return observed.with_force(force), force


def test_drawn_errors_have_the_covariance_stated(seen):
    observed, force = seen
    errors = error_model(observed, NOISE, force, [NuisanceEffect("fat", 0.05 * force, Cause("fat"))])
    drawn = errors.draw(6000, np.random.default_rng(1))
    sd = np.sqrt(np.diag(errors.covariance))
    found = np.cov((drawn / sd).T, bias=True)
    expected = errors.covariance / np.outer(sd, sd)
    np.testing.assert_allclose(found, expected, atol=6 / np.sqrt(6000))
    np.testing.assert_allclose(errors.whitened(errors.covariance), errors.lower.T, atol=1e-10)


def test_the_covariance_is_the_sum_of_its_parts(seen):
    """A trial reads (1 + g + g_t) F + b_t + e: written out pair by pair."""
    observed, force = seen
    errors = error_model(observed, NOISE, force, [NuisanceEffect("fat", 0.05 * force, Cause("fat"))])
    same = np.equal.outer(observed.trial, observed.trial)
    both = np.outer(force, force)
    shared = (COMMON_GAIN_SD**2 + 0.05**2) * both
    trials = same * (errors.gain_sd**2 * both + errors.zero_sd**2)
    own = trial_covariance(observed, NOISE)
    model = errors.covariance - shared - trials - own
    # What is left is the model's own error: a share of the force, alike in all trials.
    first = np.flatnonzero(observed.trial == 0)
    m = len(first)
    np.testing.assert_allclose(
        model[:m, :m] - np.diag(np.diag(model[:m, :m])),
        model[:m, m : 2 * m] - np.diag(np.diag(model[:m, m : 2 * m])),
        atol=1e-12,
    )
    assert np.sqrt(model[m - 1, m - 1]) == pytest.approx(NUMERICAL_ERROR * force[m - 1], rel=0.02)
    assert not np.any(own[~same])
    assert errors.names == ("load cell's gain", "fat")


def test_errors_of_a_part_are_those_of_the_whole(seen):
    observed, force = seen
    errors = error_model(observed, NOISE, force, [NuisanceEffect("fat", 0.05 * force, Cause("fat"))])
    kept = observed.trial != 1
    part = errors.part(kept)
    np.testing.assert_allclose(part.covariance, errors.covariance[np.ix_(kept, kept)])
    assert part.known.shape == (kept.sum(), 2)


def test_slow_errors_lose_touch_over_time_and_over_the_way_walked():
    observed, predictor = observations(two_rates()[:1])
    observed = observed.with_force(predictor(TRUTH))
    slow = trial_covariance(observed, replace(NOISE, wander_sd=0.0))
    k = np.flatnonzero(observed.phase == "hold")[-1]
    apart = abs(observed.time[0] - observed.time[k])
    jitter = np.sqrt(observed.jitter_variance[[0, k]]).prod()
    jitter *= observed.stiffness[0] * observed.stiffness[k]
    assert slow[0, k] == pytest.approx(NOISE.slow_sd**2 * np.exp(-apart / NOISE.correlation_time), abs=jitter)
    wander = trial_covariance(observed, replace(NOISE, slow_sd=0.0))
    size = np.sqrt(np.diag(wander))
    loading = np.flatnonzero(observed.phase == "loading")
    unloading = np.flatnonzero(observed.phase == "unloading")
    top = wander[loading[-1], unloading[0]] / size[loading[-1]] / size[unloading[0]]
    near = wander[loading[-1], loading[-2]] / size[loading[-1]] / size[loading[-2]]
    assert near > 0.8, "a moment ago the sensor erred alike"
    assert top < 0.2, "the drive stopped, time passed and it turned"


@pytest.mark.parametrize(("slow", "wander"), [(0.005, 0.005), (0.06, 0.005), (0.005, 0.05)])
def test_slow_errors_are_estimated_from_repeats(slow, wander):
    """Five repeats with gains and zeros of their own besides, which are left out of it."""
    observed, predictor = observations(ramps(5))
    force = predictor(TRUTH)
    true = observed.with_force(force)
    given = replace(NOISE, slow_sd=slow, wander_sd=wander)
    errors = error_model(true, given, force)
    unstated = replace(INSTRUMENT, stated=False)
    found = []
    for seed in range(4):
        drawn = errors.draw(1, np.random.default_rng(seed))[0]
        found.append(estimate_noise(true.with_force(force + drawn), unstated))
    middle = np.median([[n.slow_sd, n.wander_sd] for n in found], axis=0)
    larger = 0 if slow > 0.01 else 1
    assert middle[larger] == pytest.approx((slow, wander)[larger], rel=0.5)
    # The other one is small, and isn't made large by it.
    assert middle[1 - larger] < 4 * (slow, wander)[1 - larger]


def test_gains_and_zeros_of_trials_are_not_taken_for_slow_errors(seen):
    observed, force = seen
    quiet = noisy(observed, force, 3)
    plain = estimate_noise(quiet, INSTRUMENT)
    shift = np.array([0.04, -0.05, 0.01])[observed.trial]
    scattered = quiet.with_force(quiet.force * (1 + shift) + 4 * shift)
    other = estimate_noise(scattered, INSTRUMENT)
    assert other.slow_sd == pytest.approx(plain.slow_sd, rel=0.2)
    assert other.wander_sd == pytest.approx(plain.wander_sd, rel=0.2)


def test_one_trial_has_the_data_sheet_s_errors():
    observed, predictor = observations(ramps(1))
    observed = observed.with_force(predictor(TRUTH))
    noise = estimate_noise(observed, INSTRUMENT)
    assert noise.correlation_time == observed.slowest
    total = noise.white_sd**2 + noise.slow_sd**2
    assert total == pytest.approx(INSTRUMENT.force_sd**2, rel=1e-9)
    doubled = replace(INSTRUMENT, force_sd=2 * INSTRUMENT.force_sd)
    assert estimate_noise(observed, doubled).slow_sd > 1.5 * noise.slow_sd


def test_where_errors_are_known_from_is_said():
    alone = recorded(Protocol.ramp(15.0, 0.5))
    twice = recorded(Protocol.ramp(15.0, 0.5), Protocol.ramp(15.0, 0.5))
    unstated = replace(INSTRUMENT, stated=False)
    assert "no repeats" in estimate_noise(alone, INSTRUMENT).source
    # A data sheet doesn't know how quiet what was pressed is; repeats would show it.
    best = Instrument(1e-4, 1e-4)
    quiet, living = (estimate_noise(alone, best, at_rest=share).slow_sd for share in (0.0, USUAL_AT_REST))
    assert living == pytest.approx(USUAL_AT_REST * np.abs(alone.force).max())
    assert quiet < 0.1 * living
    assert estimate_noise(twice, INSTRUMENT, at_rest=0.5) == estimate_noise(twice, INSTRUMENT)
    assert estimate_noise(twice, INSTRUMENT).source == ("the repeats and the instrument's stated accuracy")
    assert "stated accuracy" not in estimate_noise(twice, unstated).source


def test_a_common_relative_error_does_not_draw_a_fit_below_all_data(monkeypatch):
    """Peelle's puzzle: two trials that differ by more than their own errors."""
    observed, _ = observations(ramps(2))
    curve = 0.05 * observed.displacement**2
    seen = observed.with_force(curve * np.where(observed.trial == 0, 1.0, 1.15))

    monkeypatch.setattr("legfem.inverse.errors.NUMERICAL_ERROR", 0.1)

    def scale(force):
        errors = error_model(seen, replace(NOISE, zero_sd=0.001), force)
        errors = replace(errors, gain_sd=0.0)
        basis, data = errors.whitened(curve), errors.whitened(seen.force)
        return float(basis @ data / (basis @ basis))

    assert scale(seen.force) < 1.0, "shares of the recorded force draw it below both trials"
    assert 1.0 < scale(1.075 * curve) < 1.15

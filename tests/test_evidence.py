"""Evidence against densities written out in full, against integrals, and against closed forms."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.special import logsumexp, softmax
from scipy.stats import multivariate_normal, norm

from legfem.inverse.errors import GAIN_SDS, ZERO_FACTORS, ErrorModel
from legfem.inverse.evidence import Discrepancy, Evidence, Linearisation, factor_of
from legfem.inverse.posterior import Posterior
from legfem.inverse.trial_noise import Noise

N = 30
ALONG = np.linspace(0.0, 1.0, N)
FORCE = 2.0 + 10 * ALONG**2
TRIAL = np.arange(N) % 2
WIDE = np.full(2, 60.0)
NONE = Discrepancy(None, 0.0, 0.0)


def errors_of(white: float = 0.05, known: int = 2) -> ErrorModel:
    """Return errors of two trials that take turns, with effects of what isn't known."""
    apart = np.abs(ALONG[:, None] - ALONG[None, :])
    trials = np.eye(2)[TRIAL]
    effects = np.column_stack([0.05 * FORCE, 0.1 * np.cos(3 * ALONG)])[:, :known]
    return ErrorModel(
        Noise(white, 0.0, 1.0, 0.02, 0.0, "made"),
        white**2 * np.eye(N) + 0.03**2 * np.exp(-apart / 0.3),
        effects,
        trials * FORCE[:, None],
        trials,
        np.full(N, white),
        of_model=np.zeros((N, N)),
    )


def about(departure=(0.0, 0.0), low=-WIDE, high=WIDE, seed: int = 0) -> Linearisation:
    """Return a model that is linear in two parameters, about any departures of them."""
    generator = np.random.default_rng(seed)
    jacobian = np.column_stack([0.3 * ALONG, 0.2 * ALONG**3])
    observed = jacobian @ [0.8, -0.5] + 0.06 * generator.normal(size=N)
    at = np.array(departure)
    return Linearisation(observed - jacobian @ at, jacobian, at, np.array(low), np.array(high))


def ripple(size: float) -> Discrepancy:
    """Return an error of unknown shape, a third as probable as none."""
    apart = np.subtract.outer(ALONG, ALONG) / 0.15
    covariance = (size * FORCE.max()) ** 2 * np.exp(-0.5 * apart**2)
    return Discrepancy(covariance, size, float(np.log(1 / 3)))


def log_shares(count: int) -> np.ndarray:
    """Return logarithms of the shares of sizes, one standard deviation apart."""
    steps = norm.logpdf(np.arange(count) - (count - 1) / 2)
    return steps - logsumexp(steps)


def in_full(errors: ErrorModel, given: Linearisation, unknowns: list[Discrepancy]) -> float:
    """Return the evidence by the densities of all sizes, nothing factorised, no bounds."""
    model = given.jacobian @ given.jacobian.T
    logs = []
    shares = log_shares(len(GAIN_SDS)), log_shares(len(ZERO_FACTORS))
    for unknown, (k, gain), (j, zero) in product(unknowns, enumerate(GAIN_SDS), enumerate(errors.zero_sds)):
        total = replace(errors, gain_sd=gain, zero_sd=zero).covariance + model
        if unknown.covariance is not None:
            total = total + unknown.covariance
        centred = given.residual + given.jacobian @ given.prior_z
        logs.append(
            multivariate_normal.logpdf(centred, np.zeros(N), total) + shares[0][k] + shares[1][j] + unknown.log_prior
        )
    return float(logsumexp(logs))


def of(errors: ErrorModel, given: Linearisation, unknowns: list[Discrepancy]) -> Posterior:
    return Evidence(errors, unknowns).of(given)


@pytest.mark.parametrize("departure", [(0.0, 0.0), (0.8, -0.5), (-2.0, 3.0)])
def test_evidence_is_the_density_of_the_data_with_all_unknowns_integrated_out(departure):
    errors, unknowns = errors_of(), [NONE, ripple(0.01), ripple(0.05)]
    given = about(departure)
    assert of(errors, given, unknowns).log_evidence == pytest.approx(in_full(errors, given, unknowns), abs=1e-8)


def test_nuisances_that_do_something_else_beside_an_explanation_count_as_if_they_did_so_beside_all():
    errors, unknowns, given = errors_of(), [NONE, ripple(0.01)], about((0.8, -0.5))
    altered = replace(errors, known=1.7 * errors.known, gains=0.8 * errors.gains)
    beside = Evidence(errors, unknowns).of(given, errors=altered)
    assert beside.log_evidence == pytest.approx(in_full(altered, given, unknowns), abs=1e-8)
    assert abs(beside.log_evidence - of(errors, given, unknowns).log_evidence) > 0.1


def test_about_what_fit_a_linear_model_is_seen_does_not_matter():
    errors = errors_of()
    one, other = (of(errors, about(at), [NONE]) for at in ((0.0, 0.0), (3.0, -1.0)))
    assert one.log_evidence == pytest.approx(other.log_evidence, abs=1e-9)
    np.testing.assert_allclose(one.mean, other.mean, atol=1e-10)


def test_evidence_is_the_likelihood_s_integral_over_a_parameter_within_its_bounds():
    """One parameter, half its normal expectation cut off: the integral by a fine sum."""
    errors = errors_of()
    low, high = np.array([-0.2, -60.0]), np.array([0.9, 60.0])
    given = about(low=low, high=high)
    alone = Linearisation(given.residual, given.jacobian[:, :1], given.prior_z[:1], low[:1], high[:1])
    fine = np.linspace(low[0], high[0], 201)
    evidence = Evidence(errors, [NONE])
    without = Linearisation(given.residual, np.zeros((N, 1)), np.zeros(1), np.array([-60.0]), np.array([60.0]))
    # A parameter that changes nothing is the likelihood at a point of the other.
    at = [evidence.of(replace(without, residual=given.residual - z * given.jacobian[:, 0])) for z in fine]
    prior = norm.logpdf(fine) - np.log(norm.cdf(high[0]) - norm.cdf(low[0]))
    density = np.array([p.log_evidence for p in at]) + prior
    most = density.max()
    integral = most + np.log(np.trapezoid(np.exp(density - most), fine))
    # The posterior is a mixture over sizes, and its tails are cut as those of a normal one.
    assert evidence.of(alone).log_evidence == pytest.approx(integral, abs=0.02)


def test_bounds_that_cut_nothing_off_change_nothing_and_those_that_cut_all_cost_much():
    errors = errors_of()
    unbounded = of(errors, about(), [NONE])
    free = unbounded.log_evidence
    wide = of(errors, about(low=[-9.0, -9.0], high=[9.0, 9.0]), [NONE]).log_evidence
    assert wide == pytest.approx(free, abs=1e-6)
    # A bound at the expected value takes half of what was possible: gained where data agree.
    half = of(errors, about(low=[0.0, -60.0]), [NONE])
    mean, sd = unbounded.mean[0], np.sqrt(unbounded.covariance[0, 0])
    assert half.log_evidence - free == pytest.approx(float(norm.logcdf(mean / sd) - np.log(0.5)), abs=1e-9)
    # Bounds that hold none of what the data say cost more than they cut off beforehand.
    wrong = of(errors, about(low=[-60.0, -60.0], high=[-2.0, 60.0]), [NONE]).log_evidence
    assert wrong < free - 1.0


@pytest.mark.parametrize("pull", [4.0, 30.0])
def test_a_parameter_drawn_far_beyond_its_bound_pays_for_all_of_the_way(pull):
    """The better fit that lies beyond the bound is out of reach, however much better it is."""
    errors = errors_of()
    given = about(low=[0.0, -60.0])
    away = replace(given, residual=given.residual - pull * given.jacobian[:, 0])
    free = of(errors, replace(away, low=np.array([-60.0, -60.0])), [NONE])
    pinned = of(errors, away, [NONE])
    z = free.mean[0] / np.sqrt(free.covariance[0, 0])
    assert z < -3.0
    assert pinned.log_evidence - free.log_evidence == pytest.approx(float(norm.logcdf(z) - np.log(0.5)), rel=1e-9)
    assert 0 < pinned.mean[0] < np.sqrt(free.covariance[0, 0])


def test_what_the_data_say_is_that_of_a_linear_model_with_normal_errors():
    """One size of gains and zeros dominates none: moments of the mixture, by Bayes' rule."""
    errors, given = errors_of(), about((1.0, 1.0))
    centred = given.residual + given.jacobian @ given.prior_z
    logs, means, spreads = [], [], []
    shares = log_shares(len(GAIN_SDS)), log_shares(len(ZERO_FACTORS))
    for (k, gain), (j, zero) in product(enumerate(GAIN_SDS), enumerate(errors.zero_sds)):
        covariance = replace(errors, gain_sd=gain, zero_sd=zero).covariance
        spread = np.linalg.inv(np.eye(2) + given.jacobian.T @ np.linalg.solve(covariance, given.jacobian))
        means.append(spread @ given.jacobian.T @ np.linalg.solve(covariance, centred))
        spreads.append(spread)
        total = covariance + given.jacobian @ given.jacobian.T
        logs.append(multivariate_normal.logpdf(centred, np.zeros(N), total) + shares[0][k] + shares[1][j])
    weights = softmax(logs)
    mean = weights @ np.array(means)
    second = sum(w * (s + np.outer(m, m)) for w, s, m in zip(weights, spreads, means, strict=True)) - np.outer(
        mean, mean
    )
    found = of(errors, given, [NONE])
    np.testing.assert_allclose(found.mean, mean, atol=1e-10)
    np.testing.assert_allclose(found.covariance, second, atol=1e-10)
    gains = np.repeat(GAIN_SDS, len(ZERO_FACTORS))
    assert found.gain_sd == pytest.approx(float(weights @ gains), rel=1e-9)
    assert found.discrepancy_probability == 0.0 and found.discrepancy_size == 0.0


def test_means_are_the_truth_s_where_data_are_many_and_intervals_hold_it_in_95_of_100():
    """Truths from what is known beforehand, errors from the model: posterior z is normal."""
    errors = errors_of()
    evidence = Evidence(errors, [NONE])
    generator = np.random.default_rng(1)
    jacobian = about().jacobian
    steps = []
    for _ in range(120):
        truth = generator.normal(size=2)
        sizes = generator.choice(GAIN_SDS, p=np.exp(log_shares(len(GAIN_SDS))))
        zero = generator.choice(errors.zero_sds, p=np.exp(log_shares(len(ZERO_FACTORS))))
        drawn = replace(errors, gain_sd=float(sizes), zero_sd=float(zero)).draw(1, generator)[0]
        given = Linearisation(jacobian @ truth + drawn, jacobian, np.zeros(2), -WIDE, WIDE)
        found = evidence.of(given)
        steps.append((found.mean - truth) / np.sqrt(np.diag(found.covariance)))
    inside = np.mean(np.abs(steps) < 1.96)
    assert 0.92 < inside < 0.98
    assert np.std(steps) == pytest.approx(1.0, abs=0.1)


def test_something_unknown_is_probable_only_where_it_is_there():
    errors, unknowns = errors_of(), [NONE, ripple(0.01), ripple(0.05)]
    quiet = of(errors, about(), unknowns)
    wave = about()
    wave = replace(wave, residual=wave.residual + 0.6 * np.sin(20 * ALONG))
    loud = of(errors, wave, unknowns)
    assert quiet.discrepancy_probability < 0.4
    assert loud.discrepancy_probability > 0.99
    assert loud.discrepancy_size == pytest.approx(0.05, abs=0.01)
    # Shares given beside an explanation stand in for those the unknowns were made with.
    barred = Evidence(errors, unknowns).of(wave, [0.0, -np.inf, -np.inf])
    assert barred.discrepancy_probability == 0.0
    assert barred.log_evidence == pytest.approx(of(errors, wave, [NONE]).log_evidence, abs=1e-9)


def test_effects_of_what_is_not_known_are_found_in_standard_deviations():
    """Small other errors: an effect of the fat of two standard deviations is seen as such."""
    errors = errors_of(white=0.002)
    errors = replace(errors, dense=0.002**2 * np.eye(N))
    given = Linearisation(2.0 * errors.known[:, 1], np.zeros((N, 1)), np.zeros(1), -WIDE[:1], WIDE[:1])
    found = of(errors, given, [NONE])
    assert found.effects[1] == pytest.approx(2.0, abs=0.1)
    assert abs(found.effects[0]) < 0.3


def test_effects_beyond_rounding_have_a_factor_yet():
    """The sum's smallest eigenvalue is 1, which rounding of 1e19 takes away."""
    one = np.random.default_rng(1).normal(size=(40, 1))
    effects = 3e9 * np.hstack([one, one + 1e-9 * np.random.default_rng(2).normal(size=(40, 1))])
    with pytest.raises(np.linalg.LinAlgError):
        np.linalg.cholesky(np.eye(2) + effects.T @ effects)
    factor = factor_of(effects)
    assert (np.diag(factor) > 0).all() and factor[0, 1] == 0
    np.testing.assert_allclose(factor @ factor.T, np.eye(2) + effects.T @ effects, rtol=1e-9)

"""Least squares, intervals, words and the emulator, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.optimize import differential_evolution
from scipy.stats import t as student_t

from legfem.inverse.emulator import Emulator
from legfem.inverse.intervals import Estimated, SquaresProfile, bound_of, effective_degrees, quantile
from legfem.inverse.least_squares import gauss_newton_step, inverse_in_units, least_residual, sandwich
from legfem.inverse.parameter import Domain, Parameter, Prior, Priors
from legfem.inverse.settings import Genetic, Minimum

FREE = (-1e3, 1e3)


@pytest.mark.parametrize("scale", ["linear", "log", "tailed"])
def test_a_prior_s_departure_its_inverse_and_its_derivative_agree(scale) -> None:
    prior = Prior(2.0, 0.5, scale)
    priors = Priors((Parameter("a", "-", (-1e3, 1e3), prior),))
    for z in (-1.5, 0.0, 0.7, 3.0):
        value = prior.value_at(z)
        assert prior.departure(value) == pytest.approx(z, abs=1e-12)
        before, after = (priors.residual(np.array([value + h])) for h in (-1e-5, 1e-5))
        assert priors.jacobian(np.array([value]))[0, 0] == pytest.approx(float(after - before) / 2e-5, rel=1e-6)


def test_what_is_far_beyond_a_tailed_prior_is_as_likely_as_ten_deviations_are_three() -> None:
    usual, tailed = Prior(0.0, 0.005), Prior(0.0, 0.005, "tailed")
    assert tailed.departure(0.05) == pytest.approx(3.0, abs=0.01) and usual.departure(0.05) == pytest.approx(10.0)
    assert tailed.departure(1e-4) == pytest.approx(usual.departure(1e-4), rel=1e-3)
    assert tailed.width(0.0) == usual.width(0.0) == usual.width(0.05) == 0.005


def linear_gaussian(p: int, seed: int = 0):
    """A straight model with correlated errors, and its exact answer."""
    rng = np.random.default_rng(seed)
    n = 30
    matrix = rng.standard_normal((n, p)) + np.linspace(0, 1, n)[:, None]
    apart = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    covariance = 0.04 * np.exp(-apart / 3.0)
    truth = np.linspace(1.0, 2.0, p)
    data = matrix @ truth + rng.multivariate_normal(np.zeros(n), covariance)
    weighting = np.linalg.inv(np.linalg.cholesky(covariance))
    return matrix, data, covariance, weighting


@pytest.mark.parametrize("p", [1, 2, 3, 5])
def test_profile_intervals_of_a_linear_gaussian_model_are_the_closed_form(p: int) -> None:
    matrix, data, covariance, weighting = linear_gaussian(p)
    parameters = (Parameter("a", "-", FREE, Prior(1.2, 0.05)), *(Parameter(f"b{k}", "-", FREE) for k in range(p - 1)))
    priors = Priors(parameters)

    def residual(values: np.ndarray) -> np.ndarray:
        own = (values @ matrix.T - data) @ weighting.T
        return np.concatenate([own, priors.residual(values)], axis=-1)

    information = matrix.T @ np.linalg.solve(covariance, matrix)
    information[0, 0] += 1 / 0.05**2
    right = matrix.T @ np.linalg.solve(covariance, data)
    right[0] += 1.2 / 0.05**2
    exact, spread = np.linalg.solve(information, right), np.linalg.inv(information)
    bounds = np.tile(FREE, (p, 1))
    start = np.zeros(p)
    jacobian = np.vstack([weighting @ matrix, priors.jacobian(start)])
    found = start + gauss_newton_step(jacobian, residual(start), bounds - start[:, None])
    assert found == pytest.approx(exact, rel=1e-10)
    assert least_residual(residual, start, bounds) == pytest.approx(exact, rel=1e-6)
    gain = inverse_in_units(jacobian) @ block_diag(weighting, 1.0)
    assert sandwich(gain, block_diag(covariance, 1.0)) == pytest.approx(spread, rel=1e-9)
    curvature = np.linalg.inv(jacobian.T @ jacobian)
    for k in range(p):
        error, times = math.sqrt(spread[k, k]), 2.2
        rise = times**2 * spread[k, k] / curvature[k, k]
        interval = SquaresProfile(residual, found, k, bounds, 0.3 * error).interval(rise)
        wald = exact[k] - times * error, exact[k] + times * error
        assert interval == pytest.approx(wald, abs=1e-5 * error)


def test_weighting_that_is_not_that_of_the_errors_has_the_sandwich_as_covariance() -> None:
    matrix, data, covariance, _ = linear_gaussian(2)
    gain = inverse_in_units(matrix)
    spread = sandwich(gain, covariance)
    rng = np.random.default_rng(3)
    noise = rng.multivariate_normal(np.zeros(len(data)), covariance, size=20_000)
    drawn = np.linalg.lstsq(matrix, noise.T, rcond=None)[0]
    assert np.cov(drawn) == pytest.approx(spread, rel=0.05)


def test_an_interval_ends_at_a_bound_and_a_step_too() -> None:
    def residual(values: np.ndarray) -> np.ndarray:
        a, b = np.moveaxis(values, -1, 0)
        return np.stack([a - 0.1, b - 2.0, a + b - 2.1], axis=-1)

    bounds = np.array([[0.0, 5.0], [0.0, 5.0]])
    low, high = SquaresProfile(residual, np.array([0.1, 2.0]), 0, bounds, 0.5).interval(4.0)
    assert low == 0.0 and 1.0 < high < 2.5
    jacobian = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    at = np.array([4.0, 1.0])
    step = gauss_newton_step(jacobian, residual(at) - 10, bounds - at[:, None])
    assert at[0] + step[0] == 5.0


def test_priors_are_departures_and_their_slopes() -> None:
    parameters = (
        Parameter("a", "MPa", (0.0, 9.0), Prior(2.0, 0.5)),
        Parameter("b", "MPa", (0.0, 9.0)),
        Parameter("c", "MPa", (0.1, 9.0), Prior(3.0, math.log(1.5), "log")),
    )
    priors, at = Priors(parameters), np.array([2.5, 7.0, 4.5])
    assert len(priors) == 2 and priors.residual(at) == pytest.approx([1.0, 1.0])
    slopes = np.column_stack(
        [(priors.residual(at + move) - priors.residual(at - move)) / 2e-6 for move in np.eye(3) * 1e-6]
    )
    assert priors.jacobian(at) == pytest.approx(slopes, abs=1e-7)
    assert priors.residual(np.tile(at, (4, 1))).shape == (4, 2)
    assert Priors(parameters[1:2]).residual(np.ones((4, 1))).shape == (4, 0)


@pytest.mark.parametrize(("scale", "bounds"), [("log", (0.02, 30.0)), ("log", (0.0, 50.0)), ("linear", (-2.0, 3.0))])
def test_genes_span_the_bounds_and_go_back(scale: str, bounds: tuple[float, float]) -> None:
    domain = Domain((Parameter("a", "-", bounds, scale=scale),))  # type: ignore[arg-type]
    genes = np.linspace(0, 1, 21)[:, None]
    values = domain.values(genes)
    assert values[[0, -1], 0] == pytest.approx(bounds) and (np.diff(values[:, 0]) > 0).all()
    assert domain.genes(values) == pytest.approx(genes, abs=1e-12)
    assert domain.values(np.array([[-1.0], [2.0]]))[:, 0] == pytest.approx(bounds)


@pytest.mark.parametrize("p", [0, 1, 2, 3, 5])
def test_emulator_meets_its_samples_and_their_slopes(p: int) -> None:
    rng = np.random.default_rng(p)
    mix, grid = rng.uniform(0.2, 1.0, p), np.linspace(1.0, 20.0, 9)

    def force(at: np.ndarray) -> np.ndarray:
        level = np.exp(at @ mix)[..., None]
        return level * grid / (1 + 0.1 * level * grid / (5 + np.sum(at**2, axis=-1)[..., None]))

    at = np.zeros((1, 0)) if p == 0 else rng.uniform(-1.0, 1.0, (2 * p + 3, p))
    step = 1e-5
    moves = step * np.eye(p)
    slopes = (
        np.stack([(force(at + move) - force(at - move)) / (2 * step) for move in moves], axis=1)
        if p
        else np.zeros((1, 0, len(grid)))
    )
    emulator = Emulator(at, force(at), slopes)
    assert emulator(at) == pytest.approx(force(at), rel=1e-3)
    for move in moves:
        slope = (emulator(at + move) - emulator(at - move)) / (2 * step)
        true = (force(at + move) - force(at - move)) / (2 * step)
        assert slope == pytest.approx(true, rel=0.02, abs=0.02 * np.abs(force(at)).max())
    between = rng.uniform(-0.7, 0.7, (20, p)) if p else at
    assert emulator(between) == pytest.approx(force(between), rel=0.03)


def test_words_follow_the_width_the_bound_the_model_and_the_prior() -> None:
    def verdict(half: float, model_fits: bool, value: float = 1.0) -> str:
        parameter = Parameter("deep.C10", "MPa", (1e-3, 2.0), scale="log")
        return Estimated(parameter, value, half / 2, (value - half, value + half)).verdict(model_fits)

    assert verdict(0.099, True) == "identifiable"
    assert verdict(0.099, False) == verdict(0.11, True) == "weakly identifiable"
    assert verdict(0.51, True) == verdict(0.01, True, 2.0) == verdict(0.9, True) == "not identifiable"
    assert verdict(math.nan, True) == "not identifiable"
    stiff = Parameter("a", "MPa", (0.01, 9.0), Prior(2.0, 0.1), scale="log")
    assert Estimated(stiff, 2.0, 0.05, (1.9, 2.1)).verdict(True) == "identifiable"
    only_prior = Estimated(stiff, 2.0, 0.099, (1.8, 2.2))
    assert only_prior.verdict(True) == "not identifiable"
    zero = Parameter("b", "N", (-2.0, 2.0))
    assert Estimated(zero, 0.0, 0.05, (-0.1, 0.1)).relative_half_width == pytest.approx(0.05)
    known = Parameter("b", "N", (-2.0, 2.0), Prior(0.0, 0.5))
    assert Estimated(known, 0.0, 0.05, (-0.098, 0.098)).relative_half_width == pytest.approx(0.1)
    assert bound_of(0.0, (0.0, 1.0)) == "lower" and bound_of(0.5, (0.0, 1.0)) == ""
    assert quantile(0) > quantile(10) > 1.96


def by_differential_evolution(cost, starts, seed):
    """The example of `legfem.inverse.settings`."""
    found = differential_evolution(
        lambda columns: cost(columns.T),
        bounds=[(0, 1)] * starts.shape[1],
        x0=starts[0],
        seed=seed,
        vectorized=True,
        updating="deferred",
        polish=False,
        popsize=8,
        maxiter=40,
    )
    return Minimum(found.x, float(found.fun))


@pytest.mark.parametrize("minimiser", [Genetic(), by_differential_evolution])
def test_minimisers_find_the_valley_where_costs_are_not_known_everywhere(minimiser) -> None:
    aim = np.array([0.3, 0.8, 0.55])

    def cost(genes: np.ndarray) -> np.ndarray:
        value = np.sum((genes - aim) ** 2, axis=-1) + 0.02 * np.sum(1 - np.cos(12 * (genes - aim)), axis=-1)
        return np.where(genes[..., 0] > 0.9, np.inf, value)

    starts = np.full((1, 3), 0.5)
    found = minimiser(cost, starts, 1)
    assert np.abs(found.best - aim).max() < 0.05
    assert found.cost == pytest.approx(float(cost(found.best)))
    again = minimiser(cost, starts, 1)
    assert np.array_equal(found.best, again.best)


def test_intervals_of_a_variance_known_in_part_cover_as_often_as_they_say():
    """Welch's and Satterthwaite's degrees of freedom, by drawing what is known of one part."""
    generator = np.random.default_rng(3)
    number, degrees, part, rest = 20_000, 4.0, 1.5, 0.5
    seen = part * generator.chisquare(degrees, number) / degrees
    off = generator.normal(scale=np.sqrt(part + rest), size=number)
    quantiles = student_t.isf(0.025, [effective_degrees(one + rest, [(one, degrees)]) for one in seen])
    covered = np.mean(np.abs(off) < quantiles * np.sqrt(seen + rest))
    assert 0.93 < covered < 0.97
    assert effective_degrees(2.0, []) == np.inf


def test_what_moves_data_by_little_is_inverted_beside_what_moves_them_by_a_great_deal():
    jacobian = np.random.default_rng(5).standard_normal((9, 3))
    plain = inverse_in_units(jacobian)
    assert plain == pytest.approx(np.linalg.pinv(jacobian), rel=1e-9)
    units = np.array([1.0, 1e25, 1e-12])
    assert inverse_in_units(jacobian * units) * units[:, None] == pytest.approx(plain, rel=1e-9)
    still = inverse_in_units(jacobian * np.array([1.0, 1.0, 0.0]))
    assert not still[2].any() and still[:2] == pytest.approx(np.linalg.pinv(jacobian[:, :2]), rel=1e-9)


def test_columns_as_good_as_parallel_have_no_inverse_of_their_difference():
    """What derivatives' rounding tells apart would make one of two that trade exact, and the other anything."""
    one = np.random.default_rng(6).standard_normal(9)
    rounding = 1e-12 * np.random.default_rng(7).standard_normal(9)
    jacobian = np.column_stack([1e4 * one, 3.0 * one + rounding])
    inverse = inverse_in_units(jacobian)
    assert np.linalg.norm(inverse * np.linalg.norm(jacobian, axis=0)[:, None]) == pytest.approx(np.sqrt(0.5), rel=1e-3)
    assert jacobian @ inverse @ one == pytest.approx(one, rel=1e-6)

"""A mechanism's strength integrated out, beside sums over all parameters, no finite elements."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest
from making_diagnosis import ClosedForm, LinearDrift, problem_of, ramps
from scipy.stats import multivariate_normal, norm

from legfem.inverse.averaging import averaged_intervals, widened_by
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.evidence import Evidence, Linearisation, possible_discrepancies
from legfem.inverse.explain import explain
from legfem.inverse.laplace import WIDTHS, gain_of_widths, integrate_strength, laplace_posterior
from legfem.inverse.map_fit import fit
from legfem.inverse.mechanism import strength
from legfem.mechanisms import mechanism_named
from legfem.mechanisms.rig import ForceDrift

NAME = "prestress.tension"
_DRAWS = 40


@dataclass(frozen=True, eq=False)
class Tense(ClosedForm):
    """Responses to which a tension adds by a power of it: no line at any fit."""

    def relative_change(self, acting, at, observed):
        mechanism, values = acting
        if mechanism.name != "prestress":
            return super().relative_change(acting, at, observed)
        return 0.1 * (values["tension"] / 100 + 1e-6) ** 0.7 / (1 + observed.displacement / 40)


def tense(seed, tension=0.0):
    """Return a problem, its base fit and that of a tension, and the evidence."""
    problem, _ = problem_of(ramps(), seed=seed)
    predictor = replace(problem.predictor, responses=Tense())
    problem = replace(problem, predictor=predictor)
    base = fit(problem, (), {DEEP_C10: 0.0009, DEEP_C20: 0.0007})
    with_it = fit(problem, [mechanism_named("prestress")], {**base.values, NAME: 40.0 + tension})
    unknowns = possible_discrepancies(predictor.observed, base.prediction)
    return problem, base, with_it, Evidence(problem.errors, unknowns)


def log_likelihood(problem, evidence, values, shares):
    """Return the logarithm of the likelihood of values, gains, zeros and nuisances out of it."""
    observed = problem.predictor.observed
    residual = observed.force - problem.predictor(values, [mechanism_named("prestress")])
    none = np.zeros(0)
    return evidence.of(Linearisation(residual, np.zeros((len(residual), 0)), none, none, none), shares).log_evidence


def inside(fitted):
    """Return the logarithm of the priors' shares between the bounds."""
    ends = np.sort([[p.prior.departure(end) for end in p.bounds] for p in fitted.parameters])
    return float(np.log(np.diff(norm.cdf(ends))).sum())


def summed(problem, evidence, fitted, shares):
    """Return the evidence and C10's moments from sums over strengths, and draws of all else.

    The evidence has a strength of any width of its prior, the moments that of the widest.
    """
    prior = fitted.parameters[fitted.free.index(NAME)].prior
    generator = np.random.default_rng(0)
    logs, priors, stiffness = [], [], []
    steps = 4.0 * np.linspace(0.0, 1.0, 25) ** 2
    widths = np.gradient(steps)
    widths[[0, -1]] /= 2
    for z, width in zip(steps, widths, strict=True):
        held = fit(problem, fitted.mechanisms, {**fitted.values, NAME: prior.value_at(z)}, (NAME,))
        own = laplace_posterior(evidence, held, shares)
        about = multivariate_normal(own.mean, own.covariance)
        for departure in generator.multivariate_normal(own.mean, own.covariance, _DRAWS):
            log = log_likelihood(problem, evidence, held.moved(departure), shares)
            log += float(norm.logpdf(departure).sum() - about.logpdf(departure)) - inside(held)
            logs.append(log - norm.logcdf(0.0) + np.log(width / _DRAWS))
            priors.append([sum(p * norm.pdf(z, scale=w) for w, p in WIDTHS.items()), norm.pdf(z)])
            stiffness.append(departure[held.free.index(DEEP_C10)])
    total, widest = np.logaddexp.reduce(np.array(logs)[:, None] + np.log(priors))
    weights = np.exp(np.array(logs) - widest) * np.array(priors)[:, 1]
    mean = weights @ np.array(stiffness)
    return float(total), float(mean), float(np.sqrt(weights @ (np.array(stiffness) - mean) ** 2))


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_evidence_and_stiffness_are_those_of_sums_where_a_strength_is_far_from_linear(seed):
    problem, _, fitted, evidence = tense(seed)
    shares = [0.0 if u.covariance is None else -np.inf for u in evidence.unknowns]
    conditional = partial(laplace_posterior, evidence, shares=shares)
    linear = conditional(fitted)
    found = integrate_strength(fitted, linear, conditional)
    total, mean, sd = summed(problem, evidence, fitted, shares)
    k = fitted.free.index(DEEP_C10)
    assert found.log_evidence == pytest.approx(total, abs=0.1)
    assert found.mean[k] == pytest.approx(mean, abs=0.05 * sd)
    assert np.sqrt(found.covariance[k, k]) == pytest.approx(sd, rel=0.05)
    worst = max(
        abs(linear.log_evidence - total) / 0.1,
        abs(linear.mean[k] - mean) / (0.05 * sd),
        abs(np.sqrt(linear.covariance[k, k]) / sd - 1) / 0.05,
    )
    assert worst > 4, "a line would do"


def test_a_strength_that_acts_in_proportion_is_as_a_line_has_it():
    problem, base = problem_of(ramps(), {"force-drift.rate": 0.004}, seed=2)
    fitted = fit(problem, [LinearDrift()], base.values)
    evidence = Evidence(problem.errors, possible_discrepancies(problem.predictor.observed, base.prediction))
    shares = [0.0 if u.covariance is None else -np.inf for u in evidence.unknowns]
    conditional = partial(laplace_posterior, evidence, shares=shares)
    linear = conditional(fitted)
    found = integrate_strength(fitted, linear, conditional)
    of_any_width = linear.log_evidence + gain_of_widths(fitted, linear)
    assert found.log_evidence == pytest.approx(of_any_width, abs=0.05)
    sd = np.sqrt(np.diag(linear.covariance))
    np.testing.assert_allclose((found.mean - linear.mean) / sd, 0.0, atol=0.05)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), sd, rtol=0.03)


class VaguerDrift(ForceDrift):
    """A drift whose usual size is ten times as large."""

    parameters = (strength("rate", "N/s", "drift of the zero", 0.05, (-0.1, 0.1)),)


def test_a_strength_s_usual_size_decides_little_between_what_does_the_same(monkeypatch):
    problem, base = problem_of(ramps(), {"force-drift.rate": 0.004}, seed=2)
    evidence = Evidence(problem.errors, possible_discrepancies(problem.predictor.observed, base.prediction))
    shares = [0.0 if u.covariance is None else -np.inf for u in evidence.unknowns]
    conditional = partial(laplace_posterior, evidence, shares=shares)

    def gap() -> float:
        fits = [fit(problem, [one], base.values) for one in (ForceDrift(), VaguerDrift())]
        one, other = (integrate_strength(own, conditional(own), conditional).log_evidence for own in fits)
        return one - other

    of_any_width = gap()
    monkeypatch.setattr("legfem.inverse.laplace.WIDTHS", {1.0: 1.0})
    assert 1.5 < gap() < np.log(10) and abs(of_any_width) < 0.6 * gap()


def test_what_widens_an_interval_most_is_told():
    _, base, _, _ = tense(1)
    explained = explain(base, [mechanism_named("prestress"), mechanism_named("dermis")])
    assert explained.every[0].is_base
    assert widened_by(explained, DEEP_C10).names == ("prestress",)
    low, high = next(averaged_intervals(explained, DEEP_C10))
    own = explained.base.interval(DEEP_C10)
    assert high - low > 1.2 * (own[1] - own[0])
    assert widened_by(explained, "drag.size") is None

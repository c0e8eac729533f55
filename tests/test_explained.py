"""What is made of explanations: an interval over all, limits, what remains beside a name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making_diagnosed import diagnosed, diagnosed_of
from making_diagnosis import SOUGHT, TRUTH, ClosedForm, problem_of, ramps
from scipy.optimize import brentq
from scipy.stats import norm
from scipy.stats import t as student_t

from legfem.inverse.averaging import POWER, averaged_intervals, untried_pairs
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.evidence import Evidence, possible_discrepancies
from legfem.inverse.explain import explain
from legfem.inverse.explanation import INEXACT, Explained, Explanation, log_bayes_factor, singles_of
from legfem.inverse.laplace import gain_of_widths, laplace_posterior
from legfem.inverse.map_fit import fit
from legfem.inverse.posterior import Mixture
from legfem.inverse.predictor import onset_name
from legfem.inverse.verdict import explained_share, limits_of, residual_intervals
from legfem.mechanisms import mechanism_named


def explanation(like: Explanation, mean: float, sd: float, probability: float) -> Explanation:
    """Return an explanation whose first parameter is normal, of a share of an interval's weights; the others stay."""
    p = like.posterior
    mean_of, spread = p.mean.copy(), p.covariance.copy()
    mean_of[0], spread[0, 0] = mean, sd**2
    posterior = replace(p, mean=mean_of, covariance=spread, log_evidence=np.log(probability) / POWER)
    return replace(like, posterior=posterior, probability=probability)


def test_an_averaged_interval_is_that_of_a_mixture_of_distributions():
    """C10's logarithm is normal in one, Student's in the other: the mixture's quantiles by hand."""
    _, base = problem_of(ramps(), seed=1)
    like = explain(base, []).base
    one, other = explanation(like, 0.0, 0.02, 0.7), explanation(like, 0.2, 0.05, 0.3)
    one = replace(one, degrees=np.full(len(base.free), np.inf))
    other = replace(other, degrees=np.full(len(base.free), 4.0))
    prior = base.parameters[0].prior

    def share_below(c10: float) -> float:
        z = np.log(c10 / prior.centre) / prior.sd
        return 0.7 * norm.cdf(z / 0.02) + 0.3 * student_t.cdf((z - 0.2) / 0.05, 4)

    expected = [brentq(lambda c10, p=p: share_below(c10) - p, 6e-5, 19e-3, xtol=1e-15) for p in (0.025, 0.975)]
    found = next(averaged_intervals(Explained((one, other), one), DEEP_C10))
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    alone = next(averaged_intervals(Explained((replace(one, probability=1.0),), one), DEEP_C10))
    np.testing.assert_allclose(alone, one.interval(DEEP_C10), rtol=1e-6)
    assert next(averaged_intervals(Explained((one, other), one), "drag.size"), None) is None


def test_two_that_hide_at_once_are_summed_where_their_pair_was_not_tried():
    """Beside the pairs' own fits: evidence, and mean and spread of C10."""
    problem, base = problem_of(ramps(), seed=1)
    found = explain(base, SOUGHT)
    assert found.every[0].is_base
    assert not any(len(e.names) > 1 for e in found.every)
    singles = singles_of(found.every)
    pairs = {pair.names: pair for pair in untried_pairs(found, DEEP_C10)}
    assert len(pairs) == 6
    evidence = Evidence(problem.errors, possible_discrepancies(problem.predictor.observed, base.prediction))
    names = next(names for names in pairs if set(names) == {"force-drift", "preconditioning"})
    one, other = (singles[name,] for name in names)
    joint = fit(problem, [*one.fit.mechanisms, *other.fit.mechanisms], base.values)
    told, k = laplace_posterior(evidence, joint, one.log_discrepancy_weights), joint.free.index(DEEP_C10)
    told = replace(told, log_evidence=told.log_evidence + gain_of_widths(joint, told))
    summed = one.posterior.log_evidence + log_bayes_factor(other, found.base)
    assert told.log_evidence == pytest.approx(summed, abs=0.5)
    mean, variance = pairs[names].distribution.moments
    sd = np.sqrt(told.covariance[k, k])
    assert mean == pytest.approx(told.mean[k], abs=0.2 * sd)
    # The recordings bound both effects' sum better than each: the sum is no narrower.
    assert sd < np.sqrt(variance) < 1.25 * sd
    low, high = next(averaged_intervals(found, DEEP_C10))
    logs = {e: e.log_prior + POWER * e.posterior.log_evidence for e in found.every if not e.is_base}
    parts = [(np.exp(log - max(logs.values())), e.distribution(DEEP_C10)) for e, log in logs.items()]
    alone = Mixture.joined(*zip(*parts, strict=True))
    prior = base.parameters[0].prior
    assert low < prior.value_at(alone.quantile(0.025))
    assert high > prior.value_at(alone.quantile(0.975))


def test_mechanisms_that_explain_the_same_misfit_are_no_hidden_pair():
    """Each alone explains what the other does: their evidences don't add."""
    _, base = problem_of(ramps(), {"preconditioning.softening": 0.3}, seed=3)
    sought = [*SOUGHT, mechanism_named("muscle-contraction")]
    found = explain(base, sought)
    assert found.every[0].names == ("preconditioning",)
    assert not any("preconditioning" in pair.names for pair in untried_pairs(found, DEEP_C10))
    assert sum(pair.weight for pair in untried_pairs(found, DEEP_C10)) < 1e-3


def test_limits_hold_what_is_there_and_are_small_where_nothing_is():
    problem, base = problem_of(ramps(), seed=1)
    quiet = {limit.name: limit for limit in limits_of(explain(base, SOUGHT))}
    assert set(quiet) == {m.name for m in SOUGHT}
    compliance = quiet["support-compliance"]
    assert compliance.low == 0.0, "one sign is possible"
    assert 0.0 < compliance.high < 0.15
    drift = quiet["force-drift"]
    assert drift.low < 0.0 < drift.high
    assert (drift.parameter, drift.unit) == ("rate", "N/s")
    most = max(abs(drift.low), abs(drift.high)) * problem.predictor.observed.time.max()
    assert drift.effect == pytest.approx(most, rel=1e-6)
    problem, base = problem_of(ramps(), {"support-compliance.compliance": 0.15}, seed=1)
    loud = {limit.name: limit for limit in limits_of(explain(base, SOUGHT))}
    assert loud["support-compliance"].high > 0.15


def test_what_remains_beside_a_right_name_is_told_with_trial_and_place():
    """A support that gave way, and in the first trial 0.4 N that nothing makes beyond 15 mm."""
    effects = {"support-compliance.compliance": 0.25}
    problem, _ = problem_of(ramps(), effects, seed=1)
    observed = problem.predictor.observed
    late = np.clip((observed.displacement - 12) / 6, 0.0, 1.0)
    extra = np.where(observed.trial == 0, 0.4 * late**2, 0.0)
    found = diagnosed_of(observed.with_force(observed.force + extra), ("support-compliance", "force-drift"))
    model = next(e for e in found.explained.every if e.names == ("support-compliance",))
    assert model.in_part
    left = residual_intervals(found, model)
    assert left == sorted(left, key=lambda r: -abs(r.size_N))
    first = left[0]
    assert (first.trial, first.phase) == ("trial1", "loading")
    assert 12 < first.displacement_mm[0] < 18 < first.displacement_mm[1]
    assert 0.05 < first.size_N < 0.45
    assert {r.trial for r in left} == {"trial1"}
    assert 0.0 < explained_share(found, model) < 1.0


def test_the_best_of_bad_explanations_is_none():
    """A ripple too short for what is unknown: some name weighs most, and describes nothing."""
    observed = problem_of(ramps())[0].predictor.observed
    ripple = 0.2 * np.sin(2 * np.pi * observed.displacement)
    found = diagnosed_of(observed.with_force(observed.force + ripple), [m.name for m in SOUGHT])
    best = found.explained.every[0]
    assert best.names and best.probability > 0.9
    assert not found.explained.describes(best)
    assert (found.verdict, found.models) == ("unexplained", ())
    said = found.explained.statements()[0]
    assert said.unnamed and said.probability > 0.9


def test_nothing_remains_beside_an_explanation_that_suits():
    found = diagnosed({"support-compliance.compliance": 0.15}, asked=("support-compliance",))
    model = found.models[0]
    assert not model.in_part
    for share, in_part in ((INEXACT, False), (INEXACT + 0.1, False), (0.8, True), (1.0, True)):
        posterior = replace(model.posterior, discrepancy_probability=share)
        assert replace(model, posterior=posterior).in_part is in_part  # no coin's toss
    # Nor where trials differ by more than the stated instruments make: no name tells of that.
    noise = replace(model.problem.errors.noise, beyond_force=0.07)
    differing = replace(model.problem, errors=replace(model.problem.errors, noise=noise))
    assert replace(model, fit=replace(model.fit, problem=differing)).in_part
    aside = replace(differing, aside=np.zeros(len(model.fit.residual), dtype=bool))
    assert not replace(model, fit=replace(model.fit, problem=aside)).in_part, "the part that differs was set aside"
    assert residual_intervals(found, model) == []
    assert explained_share(found, model) > 0.9
    assert explained_share(found, found.weighted_base) == pytest.approx(0.0, abs=1e-9)


def test_a_stopped_response_is_no_number_in_the_prediction():
    problem, _ = problem_of(ramps(), seed=1)

    class Stopped(ClosedForm):
        def curve(self, c10, c20):
            return np.full((len(c10), len(self.grid)), np.nan)

    predictor = replace(problem.predictor, responses=Stopped())
    assert np.isnan(predictor({**TRUTH, onset_name(0): 0.1})).all()

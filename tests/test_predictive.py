"""What models leave by phase, what is sure of several that relax, what an interval owes to how common effects are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making_diagnosed import diagnosed_of
from making_diagnosis import TRUTH, noisy, observations, problem_of, ramps, two_rates
from scipy.optimize import brentq
from scipy.stats import norm

from legfem.inverse.averaging import POWER, TIMES, averaged_intervals, robust_interval, sensitivities
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.explain import explain
from legfem.inverse.explanation import Explained
from legfem.inverse.predictive import checks_by_phase
from legfem.mechanisms import mechanism_named
from legfem.report.diagnosis_numbers import occurrence_table, phase_table
from legfem.report.diagnosis_sentences import shared_by
from legfem.report.words import capital

SLOW = [one for one in two_rates() if "rate0.4" in one.trial]


def diagnosed_with(extra, seed=1):
    """Return the diagnosis of three slow trials with something (N) that no mechanism makes, in their unloading."""
    observed, predictor = observations(SLOW)
    force = predictor(TRUTH, []) + extra * np.sin(observed.displacement / 1.5) * (observed.phase == "unloading")
    return diagnosed_of(noisy(observed, force, seed), ("force-drift",))


def test_a_null_leaves_in_every_phase_what_errors_make():
    shares = []
    for seed in (1, 2, 3):
        checks = list(checks_by_phase(diagnosed_with(0.0, seed).weighted_base))
        assert [check.phase for check in checks] == ["loading", "hold", "unloading"]
        assert all(0.05 * check.errors < check.left < 2 * check.errors for check in checks)
        shares += [check.p_value for check in checks]
    # Parameters are fitted: shares are on the high side.
    assert min(shares) > 0.01


def test_a_phase_that_a_model_does_not_describe_stands_out_alone():
    found = diagnosed_with(0.6)
    share = {check.phase: check.p_value for check in checks_by_phase(found.weighted_base)}
    assert share["unloading"] < 1e-6 < 1e-3 < min(share["loading"], share["hold"])
    table = phase_table(found)
    assert len(table.header) == len(table.rows[0])


def test_readings_that_are_set_aside_are_in_no_check():
    found = diagnosed_with(0.6)
    observed = found.observed
    aside = found.weighted_base.problem.setting_aside((observed.phase == "unloading")[observed.nearest])
    checks = checks_by_phase(replace(found.weighted_base, fit=replace(found.weighted_base.fit, problem=aside)))
    assert [check.phase for check in checks] == ["loading", "hold"]


def test_an_interval_with_a_mechanism_three_times_as_common_is_the_mixture_by_hand():
    _, base = problem_of(ramps(), seed=1)
    every = explain(base, [mechanism_named("force-drift")]).every
    like = {e.names or e.unnamed: e for e in every}

    def about(one, mean, sd, weight):
        p = one.posterior
        means, spread = p.mean.copy(), p.covariance.copy()
        means[0], spread[0, 0] = mean, sd**2
        of = replace(p, mean=means, covariance=spread, components=None, log_evidence=np.log(weight) / POWER)
        return replace(one, posterior=of, log_prior=0.0, degrees=np.full(len(one.fit.free), np.inf))

    unknown, drift = about(like[True], 0.0, 0.02, 0.8), about(like["force-drift",], 0.3, 0.04, 0.2)
    explained = Explained((unknown, drift), unknown)
    prior = base.parameters[0].prior
    (own,) = sensitivities(explained, DEEP_C10)
    assert own.mechanism == "force-drift" and own.weight == pytest.approx(0.2)
    for times, interval in ((1 / TIMES, own.rarer), (TIMES, own.commoner)):
        share = 0.2 * times / (0.8 + 0.2 * times)

        def below(z, share=share):
            return (1 - share) * norm.cdf(z / 0.02) + share * norm.cdf((z - 0.3) / 0.04)

        expected = [prior.value_at(brentq(lambda z, p=p: below(z) - p, -3.0, 3.0)) for p in (0.025, 0.975)]
        np.testing.assert_allclose(interval, expected, rtol=1e-6)
    low, high = next(averaged_intervals(explained, DEEP_C10))
    assert own.rarer[1] < high < own.commoner[1]
    assert robust_interval(explained, DEEP_C10) == (min(low, own.commoner[0]), own.commoner[1])


def test_what_nobody_has_counted_is_called_judgement():
    table = occurrence_table(diagnosed_with(0.0))
    assert table is not None and all(len(row) == len(table.header) for row in table.rows)
    assert {row[3] for row in table.rows} == {"judgement"}


def test_it_relaxes_is_said_where_every_explanation_does():
    _, base = problem_of(two_rates(), seed=1)
    sought = [mechanism_named("viscoelasticity"), mechanism_named("force-drift")]
    made = {e.names: e for e in explain(base, sought).every}
    relaxing, drift = made["viscoelasticity",], made["force-drift",]
    drained = replace(relaxing, fit=replace(relaxing.fit, mechanisms=(mechanism_named("poroelastic-drainage"),)))
    assert shared_by([relaxing, drained]).startswith("The leg relaxes")
    assert shared_by([relaxing, drift]) == ""
    assert shared_by([]) == ""


def test_what_every_explanation_has_is_said_first():
    """The muscle tenses, with a drift or with a support that gives way: that it tenses is sure."""
    _, base = problem_of(two_rates(), seed=1)
    sought = [mechanism_named(name) for name in ("muscle-contraction", "force-drift", "support-compliance")]
    tenses, drifts, gives = sought
    made = {e.names: e for e in explain(base, sought).every}

    def with_both(*mechanisms):
        one = made[mechanisms[0].name,]
        return replace(one, fit=replace(one.fit, mechanisms=mechanisms), fit_without_discrepancy=one.fit)

    listed = [with_both(tenses, drifts), with_both(gives, tenses)]
    assert shared_by(listed) == f"{capital(tenses.statement)}, whatever else was left out. "
    assert shared_by([*listed, made["force-drift",]]) == ""

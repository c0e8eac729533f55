"""Trials that show no air: they begin at the skin, or above it by less than a recording shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making_diagnosed import diagnosed_of
from making_diagnosis import GRID, INSTRUMENT, NOISE, TRUTH, ClosedForm, force_at, pressed
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, norm

from legfem.data import Recording, segment_all
from legfem.data.contact import air_is_shown
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.errors import GAIN_SDS, ZERO_FACTORS, error_model
from legfem.inverse.evidence import Discrepancy, Evidence
from legfem.inverse.laplace import STARTS_AT_CONTACT, contact_posterior
from legfem.inverse.linearised import LinearisedProblem
from legfem.inverse.map_fit import fit
from legfem.inverse.mechanism import prior_of
from legfem.inverse.observations import Observations, observe
from legfem.inverse.predictor import Predictor, detected_onset, onset_name
from legfem.inverse.verdict import Diagnosis

ALONE = [Discrepancy(None, 0.0, 0.0)]


def seen(airs: tuple[float, ...], stated: bool = False) -> Observations:
    return observe(segment_all(pressed(airs, seed=2), INSTRUMENT, stated))


def fitted_to(observed: Observations):
    predictor = Predictor(observed, ClosedForm(GRID), "reduced-polynomial")
    problem = LinearisedProblem(predictor, error_model(observed, NOISE, predictor(TRUTH)))
    return Evidence(problem.errors, ALONE), fit(problem, (), TRUTH)


@pytest.mark.parametrize(("airs", "stated"), [((0.0, 0.0), True), ((2.0, 1.0), False)], ids=["stated", "air"])
def test_what_is_stated_or_seen_leaves_one_reading(airs, stated):
    observed = seen(airs, stated)
    evidence, fitted = fitted_to(observed)
    one, other = contact_posterior(evidence, fitted, [0.0]), evidence.of(fitted.linearised)
    assert one.log_evidence == other.log_evidence
    np.testing.assert_array_equal(one.mean, other.mean)


def in_full(fitted, errors, priors) -> float:
    """Return the linearised model's density in millimetres and kPa's logarithm, bounds left out."""
    own = [prior_of(p) for p in fitted.parameters]
    by_value = fitted.sensitivities / np.array([q.sd for q in own])
    at = np.array([q.sd * z for q, z in zip(own, fitted.prior_z, strict=True)])
    at += [q.centre if q.scale == "linear" else 0.0 for q in own]
    middle = np.array([q.centre if q.scale == "linear" else 0.0 for q in priors])
    centred = fitted.residual + by_value @ (at - middle)
    model = by_value * np.array([q.sd for q in priors])
    shares = [norm.logpdf(np.arange(n) - (n - 1) / 2) for n in (len(GAIN_SDS), len(ZERO_FACTORS))]
    gain_shares, zero_shares = (logs - logsumexp(logs) for logs in shares)
    logs = [
        multivariate_normal.logpdf(
            centred, np.zeros(len(centred)), replace(errors, gain_sd=gain, zero_sd=zero).covariance + model @ model.T
        )
        + gain_share
        + zero_share
        for gain, gain_share in zip(GAIN_SDS, gain_shares, strict=True)
        for zero, zero_share in zip(errors.zero_sds, zero_shares, strict=True)
    ]
    return float(logsumexp(logs))


def test_where_no_air_is_seen_the_evidence_is_that_of_both_readings():
    observed = seen((0.0, 0.0))
    evidence, fitted = fitted_to(observed)
    touching = [prior_of(p) for p in fitted.parameters]
    detected = [
        detected_onset(observed, int(p.name[5]) - 1) if p.name.startswith("trial") else q
        for p, q in zip(fitted.parameters, touching, strict=True)
    ]
    assert detected[-1].sd > 2 * touching[-1].sd
    parts = [in_full(fitted, evidence.errors, priors) for priors in (touching, detected)]
    expected = np.logaddexp(parts[0] + np.log(STARTS_AT_CONTACT), parts[1] + np.log(1 - STARTS_AT_CONTACT))
    found = contact_posterior(evidence, fitted, [0.0])
    # C20 is bounded below by zero, which the densities above leave out.
    k = fitted.free.index(DEEP_C20)
    sd = np.sqrt(found.covariance[k, k])
    low, high = fitted.linearised.low[k], fitted.linearised.high[k]
    bounded = norm.sf((low - found.mean[k]) / sd) / (norm.cdf(high) - norm.cdf(low))
    assert found.log_evidence == pytest.approx(expected + np.log(bounded), abs=0.05)
    # The expected onset lies between those of the readings, with both one's doubt.
    mine = contact_posterior(evidence, fitted, [0.0])
    alone = evidence.of(fitted.linearised)
    j = fitted.free.index(onset_name(0))
    assert mine.covariance[j, j] >= 0.5 * alone.covariance[j, j]


def found_of(airs: tuple[float, ...]) -> Diagnosis:
    return diagnosed_of(seen(airs), ("support-compliance", "fascia-stiffness"))


def test_air_too_little_to_be_seen_gets_no_name_and_widens_the_interval():
    found = found_of((0.03, 0.0, 0.02))
    assert not found.observed.shows_air
    assert found.verdict == "consistent"
    low, high = found.intervals[DEEP_C10]
    assert low <= TRUTH[DEEP_C10] <= high
    for k, air in enumerate((0.03, 0.0, 0.02)):
        at = found.observed.contacts[k].displacement
        ends = [at + end for end in found.base_model.interval(onset_name(k))]
        assert ends[0] <= air <= ends[1]


def test_a_force_that_is_read_across_first_touch_is_predicted_as_it_is_read():
    """A straight line through samples before it and after it lies above the force there."""
    air = np.array([1.1, 1.2, 1.3, 1.4, 1.5])
    time = np.arange(0.0, 52.0, 0.02)
    force = [force_at(TRUTH[DEEP_C10], TRUTH[DEEP_C20], 0.4 * time - way) for way in air]
    trials = [Recording(time, 0.4 * time, one, f"trial{k + 1}") for k, one in enumerate(force)]
    observed = observe(segment_all(trials, INSTRUMENT, True))
    values = {**TRUTH, **{onset_name(k): float(way) for k, way in enumerate(air)}}
    predicted = Predictor(observed, ClosedForm(GRID), "reduced-polynomial")(values)
    across = np.abs(observed.displacement - air[observed.trial]) < observed.half_width
    assert across.sum() == len(air)
    plain = force_at(TRUTH[DEEP_C10], TRUTH[DEEP_C20], observed.displacement - air[observed.trial])
    assert np.abs(plain - observed.force)[across].max() > 0.025
    np.testing.assert_allclose(predicted[across], observed.force[across], atol=4e-3)


def test_trials_show_together_what_air_none_of_them_shows_alone():
    contacts = seen((0.1, 0.06, 0.08)).contacts
    assert not any(one.in_air for one in contacts)
    assert air_is_shown(contacts) and not air_is_shown(contacts[:1])

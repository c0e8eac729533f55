"""Trials that show no air: they begin at the skin, or above it by less than a recording shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making_diagnosed import diagnosed_of
from making_diagnosis import GRID, INSTRUMENT, TRUTH, ClosedForm, force_at, pressed

from legfem.data import Recording, segment_all
from legfem.data.contact import air_is_shown
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.observations import Observations, observe
from legfem.inverse.predictor import Predictor, onset_name, onset_prior
from legfem.inverse.verdict import Diagnosis


def seen(airs: tuple[float, ...], stated: bool = False) -> Observations:
    return observe(segment_all(pressed(airs, seed=2), INSTRUMENT, stated))


@pytest.mark.parametrize("chance", [0.1, 0.5, 0.9])
def test_where_no_air_is_shown_first_contact_has_the_moments_of_both_readings(chance, monkeypatch):
    """Against draws: at the recording's start, as a load cell feels it, or where it seems to be."""
    observed = seen((0.05, 0.0))
    monkeypatch.setattr("legfem.inverse.observations.chance_of_air", lambda _: chance)
    contact = replace(observed.contacts[0], displacement=0.0, estimate=0.8, displacement_error=0.3)
    observed, rng = replace(observed, contacts=(contact, *observed.contacts[1:])), np.random.default_rng(4)
    touching = onset_prior(replace(observed, starts_at_contact=True), 0)
    air = rng.random(400_000) < chance
    places = rng.normal(np.where(air, 0.8, touching.centre), np.where(air, max(0.15, 2 * touching.sd), touching.sd))
    prior = onset_prior(observed, 0)
    assert prior.centre == pytest.approx(places.mean(), abs=0.005)
    assert prior.sd == pytest.approx(places.std(), rel=0.01)


def test_trials_that_seem_to_begin_in_air_together_are_taken_as_if_they_did():
    """A press of 2 mm of air whose load cell wanders: the less it is shown, the wider first contact is left open."""
    shown, hidden = seen((2.0, 1.0)), seen((0.03, 0.0))
    assert shown.shows_air and shown.chance_of_air == 1.0
    assert not hidden.shows_air and hidden.chance_of_air < 0.5
    assert seen((2.0, 1.0), stated=True).chance_of_air == 0.0
    assert onset_prior(shown, 0).centre == shown.contacts[0].estimate - shown.contacts[0].displacement


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

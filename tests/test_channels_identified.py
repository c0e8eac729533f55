"""Layers' stiffness from force and channels beside it, on a leg in closed form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from making_identification import DEPTH, AnalyticLeg, identify, pressed_leg

from legfem.channels.kind import ChannelAccuracy
from legfem.channels.kinds import CHANNELS
from legfem.common.errors import InputError
from legfem.data.recording import RecordedChannel
from legfem.geometry.section import layer_thicknesses
from legfem.inverse.catalogue import parameter_of
from legfem.inverse.comparison import total_of
from legfem.inverse.joint_comparison import JointComparison
from legfem.inverse.outcome import Outcome
from legfem.inverse.search import SearchError
from legfem.inverse.settings import IdentificationSettings
from legfem.inverse.station_test import StationTest
from legfem.inverse.trial_noise import estimate_noise
from legfem.legs.forward import law_of
from legfem.legs.site import site_test
from legfem.legs.subject import LegAccuracy, Subject
from legfem.legs.unknowns import unknowns_at

BOTH = ("deep.C10", "superficial.C10")
TRUTH = {"deep.C10": 1.4e-3, "superficial.C10": 2.6e-3}
EXACT = ChannelAccuracy(reading=0.1, bias=0.3, gain=0.01, slow=0.05, lag=0.1)


@dataclass
class LayeredLeg(AnalyticLeg):
    """The analytic leg, whose fat takes the share of the way that its softness in series has; 6 mm at rest."""

    def solve(self, values: Mapping[str, float], sensitivities: Sequence[str]) -> Outcome:
        outcome = super().solve(values, sensitivities)
        every = {**self.nominal, **values}
        deep, fat = every["deep.C10"], every["superficial.C10"]
        d = outcome.curve.displacement
        ratio = deep / (3 * fat)
        share, by_ratio = ratio / (1 + ratio), 1 / (1 + ratio) ** 2
        lost = 0.3 * d * (1 + 0.01 * d)
        by = {"deep.C10": ratio / deep, "superficial.C10": -ratio / fat}
        slopes = {name: -lost * by_ratio * by.get(name, 0.0) for name in sensitivities}
        side = 0.1 * np.sin(d / 6) * (1e3 * deep - 1)
        by_side = {name: 100 * np.sin(d / 6) * (name == "deep.C10") for name in sensitivities}
        curve = replace(
            outcome.curve,
            channels={"fat_thickness": 6.0 - lost * share, "lateral_force": side},
            channel_sensitivities={"fat_thickness": slopes, "lateral_force": by_side},
        )
        return replace(outcome, curves=(curve,))


def recorded(
    folder: Path,
    seed: int = 0,
    names: Sequence[str] = ("fat_thickness",),
    accuracy: ChannelAccuracy = EXACT,
    every: float = 1.0,
) -> Subject:
    """The leg's recordings by `TRUTH`, its channels read with an error of every kind that they are said to have."""
    rng = np.random.default_rng(seed)
    subject = pressed_leg(folder, 1.4, 0.0, seed=seed, fat=2.6, trials=2)
    curve = LayeredLeg().solve(TRUTH, ()).curve
    bias, gain, lag = (rng.standard_normal() * sd for sd in (accuracy.bias, accuracy.gain, accuracy.lag))
    trials = []
    for trial in subject.recordings:
        time = np.arange(0.0, DEPTH / 0.4, every)
        drift = accuracy.slow * np.sin(2 * np.pi * (time / 50 + rng.uniform())) * np.sqrt(2)
        channels = []
        for name in names:
            read = curve.channel(name, 0.4 * np.maximum(time - lag, 0.0))
            read = (1 + gain) * read + bias + drift + accuracy.reading * rng.standard_normal(len(time))
            channels.append(RecordedChannel(name, time, read, accuracy))
        trials.append(replace(trial, channels=tuple(channels)))
    return replace(subject, recordings=tuple(trials), accuracy=LegAccuracy(contour_sd=0.0))


def fitted(subject: Subject, names: Sequence[str] = BOTH, **more):
    leg = LayeredLeg()
    parameters = [parameter_of(name, leg.nominal) for name in names]
    (fit,) = identify(subject, model=leg, laws=("neo-hookean",), parameters=parameters, **more)
    return fit


@pytest.fixture(scope="module")
def subject(tmp_path_factory):
    return recorded(tmp_path_factory.mktemp("leg"))


@pytest.fixture(scope="module")
def fit(subject):
    return fitted(subject)


def test_both_layers_are_found(fit):
    for name, truth in TRUTH.items():
        low, high = fit.estimates[name].ci95
        assert low < truth < high
        assert fit.estimates[name].value == pytest.approx(truth, rel=0.1)
    assert fit.weighting == "covariance"
    assert fit.goodness.fits


@pytest.mark.slow
def test_intervals_hold_the_truth_as_often_as_they_say(tmp_path):
    """Of 30 recordings with errors of every kind, 95 % intervals hold both layers in 26 at least: chance 0.99 of it."""
    held = {name: 0 for name in BOTH}
    for seed in range(30):
        found = fitted(recorded(tmp_path / "leg", seed))
        for name, truth in TRUTH.items():
            low, high = found.estimates[name].ci95
            held[name] += low < truth < high
    print(held)
    assert min(held.values()) >= 26


def test_thickness_says_most_about_the_fat(fit, subject):
    alone = fitted(replace(subject, recordings=tuple(replace(one, channels=()) for one in subject.recordings)))
    fat, before = (one.estimates["superficial.C10"] for one in (fit, alone))
    # By every trial's own readings the force tells more of the fat than its mean curve did.
    assert fat.standard_error < 0.95 * before.standard_error
    assert before.information_shares == {} and "channels" not in before.error_shares
    assert set(fat.information_shares) == {"force", "fat_thickness"}
    assert sum(fat.information_shares.values()) == pytest.approx(1.0)
    assert fat.information_shares["fat_thickness"] > 0.1
    assert fat.error_shares["channels"] > 0.1


def test_without_channels_nothing_moves(tmp_path):
    """A leg whose model has channels, and whose recordings have none: to the last bit."""
    plain = pressed_leg(tmp_path / "leg", 1.4, 0.0, fat=2.6)
    parameters = [parameter_of(name, LayeredLeg().nominal) for name in BOTH]
    one, other = (
        identify(plain, model=leg, laws=("neo-hookean",), parameters=parameters)[0]
        for leg in (LayeredLeg(), AnalyticLeg())
    )
    assert one.weighting == "covariance"
    for name in BOTH:
        assert one.estimates[name].value == other.estimates[name].value
        assert one.estimates[name].ci95 == other.estimates[name].ci95
    assert one.goodness == other.goodness


def test_a_channel_that_no_solve_shows_is_named(subject):
    parameters = [parameter_of(name, LayeredLeg().nominal) for name in BOTH]
    with pytest.raises(SearchError, match="no full solve shows all that was recorded: fat_thickness; leave that out"):
        identify(subject, model=AnalyticLeg(), laws=("neo-hookean",), parameters=parameters)


def test_the_plain_sum_can_t_weigh_them(subject):
    with pytest.raises(InputError, match="millimetres"):
        fitted(subject, settings=IdentificationSettings(weighting="paper"))


@pytest.mark.parametrize(("beyond", "instrument"), [(0.0, [1.0, 0.0, 0.0]), (1.0, [1.1, 0.05, -0.4])])
def test_predictions_have_the_derivatives_of_differences(tmp_path, beyond, instrument):
    subject = recorded(tmp_path / "leg", names=("fat_thickness", "lateral_force"))
    test = replace(site_test(subject, None), beyond=beyond)
    leg = LayeredLeg(depth=DEPTH + 1)
    instrument = np.array(instrument)
    exact = test.predict(leg.solve(TRUTH, BOTH).curve, TRUTH, instrument)
    assert len(exact.values) == len(test.data.values) == len(test.if_deeper)
    assert len(exact.model_values) == len(test.linear_scale)
    np.testing.assert_allclose(test.read(exact.model_values, instrument), exact.values, rtol=1e-12, atol=1e-12)
    for name in BOTH:
        step = 1e-5 * TRUTH[name]
        ahead, behind = (
            test.predict(leg.solve(at, ()).curve, at, instrument).values
            for at in ({**TRUTH, name: TRUTH[name] + by} for by in (step, -step))
        )
        difference = (ahead - behind) / (2 * step)
        np.testing.assert_allclose(exact.sensitivities[name], difference, atol=1e-4 * np.abs(difference).max())
    for k, name in enumerate(("instrument.gain", "instrument.zero", "instrument.contact_offset")):
        step = 1e-5 * np.eye(3)[k]
        ahead, behind = (test.read(exact.model_values, instrument + by) for by in (step, -step))
        difference = (ahead - behind) / 2e-5
        np.testing.assert_allclose(exact.sensitivities[name], difference, atol=1e-6)


def about_the_truth(subject: Subject) -> StationTest:
    """Return a leg's recordings with their errors about the model that made them."""
    test, leg = site_test(subject, None), LayeredLeg(depth=DEPTH + 1)
    curve = leg.solve(TRUTH, BOTH).curve
    noise = estimate_noise(test.observed, subject.instrument)
    law = law_of("neo-hookean", subject, leg.nominal)
    unknowns = list(unknowns_at(test, subject, curve, TRUTH, None, law, {}))
    return test.about(curve, TRUTH, test.contacts, noise, unknowns)


def covariances_of(test: StationTest) -> dict[str, np.ndarray]:
    return dict(JointComparison((test,), near=(TRUTH, test.data.values)).covariances_at(TRUTH))


@pytest.mark.parametrize("kind", ["reading", "bias", "gain", "slow", "lag"])
def test_every_error_is_as_large_as_it_is_said_to_be(tmp_path, kind):
    """The spread of readings that err in one way alone, beside the covariance for that error."""
    size = {"reading": 0.2, "bias": 0.3, "gain": 0.03, "slow": 0.2, "lag": 0.4}[kind]
    accuracy = replace(ChannelAccuracy(reading=1e-6), **{kind: size})
    every = []
    for seed in range(40):
        subject = recorded(tmp_path / "leg", seed, accuracy=accuracy, every=2.0)
        test = about_the_truth(replace(subject, recordings=subject.recordings[:1]))
        read = test.data.spans[1]
        stated = np.sqrt(np.diag(covariances_of(test)["channels"])[read])
        every.append((test.data.values[read][1:], stated[1:]))
    values, stated = (np.array(part) for part in zip(*every, strict=True))
    spread = np.sqrt(np.mean(np.std(values, axis=0, ddof=1) ** 2))
    assert spread == pytest.approx(np.sqrt(np.mean(stated**2)), rel=0.25)


def test_outlines_make_a_thickness_err(subject):
    sure, unsure = (about_the_truth(replace(subject, accuracy=LegAccuracy(contour_sd=sd))) for sd in (0.0, 0.5))
    own = layer_thicknesses(subject.section, subject.indenter.aim, subject.indenter.direction)["fat_thickness"]
    assert not any("outlines" in name for name in sure.errors.stated)
    (effect,) = (one.effect for name, one in unsure.errors.stated.items() if "outlines" in name)
    read = unsure.data.spans[1]
    at_rest = read.start + int(np.argmin(unsure.data.channels[1].station))
    assert effect[at_rest] == pytest.approx(np.sqrt(2) * 0.5 * 6.0 / own, rel=0.1)
    assert not effect[unsure.data.spans[0]].any()


def test_errors_by_source_add_up(subject):
    test = about_the_truth(replace(subject, accuracy=LegAccuracy(contour_sd=0.5)))
    errors = covariances_of(test)
    assert {"recordings", "model", "channels", "assumed", "shape"} <= set(errors)
    np.linalg.cholesky(total_of(errors))
    forces = test.data.spans[0]
    assert not np.diag(errors["channels"])[forces].any()
    # All together they are the error model's, and what leaves first contact open.
    known = test.errors.covariance + test._of_onsets
    np.testing.assert_allclose(total_of(errors), known, rtol=1e-9, atol=1e-12)
    assert test.data.channels[1].unit == CHANNELS["fat_thickness"].unit

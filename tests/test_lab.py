"""A lab's errors: as large as they say, and of the shapes that they say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import kurtosis

from legfem.legs.loading import load_subject
from studies.cases.outcomes import Rate
from studies.making.recording import INSTRUMENT, Course, LabErrors, flicker, record
from studies.making.stated import (
    CONTOURS_MM,
    GAINS,
    LEAST_FAT_MM,
    Misstated,
    drawn_errors,
    drawn_misstatement,
    misstated,
    outlines_off,
)

LEG = Path(__file__).parent / "data" / "crosscheck" / "neo-hookean"
TIME = np.linspace(0.0, 50.0, 501)
RAMP = Course(TIME, 0.4 * TIME, 0.03 * (0.4 * TIME) ** 2)


def test_without_errors_the_instruments_alone_err():
    trials = record([RAMP] * 3, LabErrors(), np.random.default_rng(1))
    errors = []
    for trial in trials:
        away = trial.force - np.interp(trial.displacement, RAMP.displacement, RAMP.force)
        errors.append(away - away.mean())
        zero = trial.force[:20].mean()
        assert abs(zero) < 0.05 + 3 * INSTRUMENT.force_sd
    assert np.std(np.concatenate(errors)) == pytest.approx(INSTRUMENT.force_sd, rel=0.5)


def test_air_comes_before_the_leg_and_differs_from_trial_to_trial():
    trials = record([RAMP] * 3, LabErrors(air=4.0), np.random.default_rng(2))
    air = [float(trial.displacement[-1]) - 20.0 for trial in trials]
    assert np.ptp(air) > 0.3
    for trial, mine in zip(trials, air, strict=True):
        assert -0.2 < mine < 4.2
        quiet = trial.force[trial.displacement < mine - 0.2]
        assert np.ptp(quiet) < 8 * INSTRUMENT.force_sd if len(quiet) else True


def test_a_drive_of_one_travel_goes_less_deep_through_more_air():
    errors = LabErrors(air=4.0, same_travel=True)
    trials = record([RAMP] * 3, errors, np.random.default_rng(2))
    assert np.ptp([trial.displacement[-1] for trial in trials]) < 0.3


@pytest.mark.parametrize("heavy", [False, True])
def test_gains_have_their_size_and_are_not_normal(heavy):
    flat = Course(TIME, 0.4 * TIME, np.full(501, 10.0))
    trials = record([flat] * 600, LabErrors(gain_sd=0.03, heavy=heavy), np.random.default_rng(3))
    gains = np.array([trial.force.mean() / 10 - 1 for trial in trials])
    assert gains.std() == pytest.approx(0.03, rel=0.25)
    assert (kurtosis(gains) > 0.3) if heavy else (kurtosis(gains) < -0.7)


def test_slow_noise_has_unit_variance_and_more_power_where_it_is_slow():
    drawn = np.array([flicker(400, np.random.default_rng(k)) for k in range(200)])
    assert drawn.var() == pytest.approx(1.0, rel=0.1)
    power = (np.abs(np.fft.rfft(drawn, axis=1)) ** 2).mean(axis=0)
    assert power[1:6].sum() > 1.5 * power[16:31].sum()


def test_outlines_are_off_by_their_size_and_smooth():
    section = load_subject(LEG, need_recordings=False).section
    moved = outlines_off(section, 0.6, np.random.default_rng(4))
    off = np.linalg.norm(moved.skin - section.skin, axis=1)
    assert np.sqrt(np.mean(off**2)) == pytest.approx(0.6, rel=1e-6)
    assert np.abs(np.diff(off)).max() < 0.2
    gap = moved.polygon("skin").exterior.distance(moved.polygon("fascia").exterior)
    assert gap > LEAST_FAT_MM
    assert outlines_off(section, 0.0, np.random.default_rng(4)) is section


def test_what_is_stated_lies_within_what_is_said():
    leg = load_subject(LEG, need_recordings=False)
    for seed in range(5):
        stated = misstated(leg, Misstated(0.3, 2.0, 3.0, 1.5), np.random.default_rng(seed))
        off = stated.indenter.aim - leg.indenter.aim
        assert abs(off @ leg.indenter.direction) < 1e-9
        assert np.linalg.norm(off) <= 2.0
        assert abs(stated.indenter.direction_deg - leg.indenter.direction_deg) <= 3.0
        for name in ("superficial", "fascia"):
            factor = stated.tissues[name].C10 / leg.tissues[name].C10
            assert 1 / 1.5 <= factor <= 1.5 and factor != 1.0


def test_all_together_are_wider_than_the_diagnosis_assumes():
    drawn = [drawn_errors(np.random.default_rng(k)) for k in range(40)]
    gains = [errors.gain_sd for errors in drawn]
    assert GAINS[0] <= min(gains) < 0.01 < 0.02 < max(gains) <= GAINS[1]
    assert {errors.heavy for errors in drawn} == {errors.same_travel for errors in drawn}
    contours = [drawn_misstatement(np.random.default_rng(k)).contour for k in range(40)]
    assert CONTOURS_MM[0] <= min(contours) < 0.5 < 0.8 < max(contours) <= CONTOURS_MM[1]


def test_a_rate_has_its_interval():
    assert str(Rate(3, 60)) == "3/60 = 5% (1% to 14%)"
    assert str(Rate(0, 0)) == "no case"

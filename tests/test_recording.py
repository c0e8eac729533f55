"""Recordings: reading, first contact, phases, the mean curve and its uncertainty."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from making import CROSSCHECK, press, tissue_force, write_recording

from legfem.common.errors import InputError
from legfem.data import Instrument, Recording, check_trial, mean_loading_curve, read_samples, segment, segment_all
from legfem.legs.loading import load_subject

INSTRUMENT = Instrument(force_sd=0.04, displacement_sd=0.02)


def _refused(path):
    with pytest.raises(InputError) as caught:
        check_trial(segment(read_samples(path)))
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith(str(path))
    assert caught.value.remedy
    return caught.value


def _with(recording, **changes):
    given = {
        "time": recording.time,
        "displacement": recording.displacement,
        "force": recording.force,
        "trial": recording.trial,
    }
    return Recording(**(given | changes))


@pytest.mark.parametrize(("name", "words"), [("time", "no time passes"), ("displacement", "nothing moves")])
def test_numbers_that_are_as_good_as_nothing_are_refused(tmp_path, name, words):
    made = press()
    lost = _with(made, **{name: 1e-310 * np.arange(1, len(made) + 1)})
    path = tmp_path / "trial.csv"
    table = {"time_s": lost.time, "displacement_mm": lost.displacement, "force_N": lost.force}
    pd.DataFrame(table).to_csv(path, index=False)
    with pytest.raises(InputError, match=words):
        read_samples(path)


def test_reading_keeps_every_sample(tmp_path):
    made = press(force_sd=0.03, displacement_sd=0.02, hold=5, unload=True)
    read = read_samples(write_recording(tmp_path / "trial7.csv", made))
    assert read.trial == "trial7"
    assert read.time == pytest.approx(made.time, abs=1e-3)
    assert read.displacement == pytest.approx(made.displacement, abs=1e-4)
    assert read.force == pytest.approx(made.force, abs=1e-4)


@pytest.mark.parametrize(
    ("change", "field", "words"),
    [
        (lambda r: _with(r, force=0.03 * np.sin(37 * r.time)), "force_N", "never touches"),
        (lambda r: _with(r, force=-r.force), "force_N", "change its sign"),
        (lambda r: _with(r, force=r.force / 1000), "force_N", "kN"),
        (lambda r: _with(r, displacement=r.displacement / 1000), "displacement_mm", "metres"),
        (lambda r: _with(r, displacement=-r.displacement), "displacement_mm", "at the start"),
        (lambda r: press(air=10, depth=3, force_sd=0.03), "displacement_mm", "too short"),
        (lambda r: press(depth=20, rate=0.3), "rows", "samples"),
        (lambda r: press(air=30, depth=12, rate=0.5), "rows", "after contact are too few"),
        (lambda r: _with(r, time=r.time[::-1]), "time_s, line 3", "backwards"),
        (lambda r: _with(r, time=np.floor(5 * r.time) / 5), "time_s, line 3", "repeats"),
    ],
)
def test_unusable_trials_are_explained(tmp_path, change, field, words):
    made = change(press(force_sd=0.01, displacement_sd=0.01))
    if words in ("kN", "metres"):
        made = change(press())
    error = _refused(write_recording(tmp_path / "trial1.csv", made))
    assert error.field == field
    assert words in str(error)


@pytest.mark.parametrize(
    ("old", "new", "field", "words"),
    [
        ("displacement_mm", "displacement", "header", "'displacement' where"),
        ("force_N", "force_kg2", "header", "'force_kg2' where 'force_N'"),
        ("time_s", "t", "header", "'time_s' is missing"),
        ("0.100,0.0400", "0,100,0,0400", "line 3", "decimal"),
        ("0.100,0.0400", '0.100,"0,0400"', "displacement_mm, line 3", "decimal comma"),
        ("0.100,0.0400", "0.100,NaN", "displacement_mm, line 3", "not a finite number"),
    ],
)
def test_unreadable_files_are_explained(tmp_path, old, new, field, words):
    path = write_recording(tmp_path / "trial1.csv", press())
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    error = _refused(path)
    assert error.field == field
    assert words in str(error)


@pytest.mark.parametrize(
    ("old", "new", "factor"),
    [
        ("force_N", "force_mN", 1e-3),
        ("force_N", "Force [kgf]", 9.80665),
        ("time_s", "time_s,displacement_mm,force_N\ntime_s", 1.0),
        ("time_s", "# rig 2\ntime_s", 1.0),
        ("force_N\n", "force_N\ns,mm,N\n", 1.0),
    ],
)
def test_own_tables_are_read_in_the_units_of_their_names_and_beside_comments(tmp_path, old, new, factor):
    path = write_recording(tmp_path / "trial1.csv", press())
    before = read_samples(path)
    path.write_text(path.read_text().replace(old, new, 1))
    read = read_samples(path)
    np.testing.assert_allclose(read.force, factor * before.force)
    np.testing.assert_allclose(read.time, before.time)


@pytest.mark.parametrize("rate", [10.0, 200.0])
@pytest.mark.parametrize("seed", range(5))
def test_contact_after_air_is_found_within_its_error(seed, rate):
    made = press(air=3.7, force_sd=0.03, displacement_sd=0.02, offset=0.4, seed=seed, rate=rate)
    contact = segment(made).contact
    assert contact.in_air
    assert contact.displacement == pytest.approx(3.7, abs=0.35)
    assert abs(contact.displacement - 3.7) < 3.5 * contact.displacement_error
    assert contact.baseline == pytest.approx(0.4, abs=0.025)


@pytest.mark.parametrize("seed", range(8))
def test_a_recording_that_begins_at_contact_is_not_shifted(seed):
    made = press(force_sd=0.05, displacement_sd=0.05, offset=0.08, seed=seed)
    contact = segment(made).contact
    assert not contact.in_air
    assert contact.displacement == 0.0
    assert contact.baseline == 0.0


def test_a_sensor_that_starts_elsewhere_is_shifted_to_first_touch():
    made = press(force_sd=0.02, displacement_sd=0.02)
    contact = segment(_with(made, displacement=made.displacement + 12.3)).contact
    assert contact.displacement == pytest.approx(12.3, abs=0.05)


@pytest.mark.parametrize("displacement_sd", [0.0, 0.02, 0.15])
@pytest.mark.parametrize("hold", [0.0, 10.0])
def test_phases_change_where_the_motion_does(displacement_sd, hold):
    air, depth = 3.7, 20.0
    made = press(air=air, depth=depth, hold=hold, unload=True, force_sd=0.03, displacement_sd=displacement_sd, seed=3)
    labels = segment(made).labels
    up = (air + depth) / 0.4
    corners = {"loading": (air / 0.4, up), "unloading": (up + hold, up + hold + depth / 0.4)}
    if hold:
        corners["hold"] = (up, up + hold)
    for phase, (start, end) in corners.items():
        when = made.time[labels == phase]
        assert when.min() == pytest.approx(start, abs=1.0)
        assert when.max() == pytest.approx(end, abs=1.0)
        assert len(when) == pytest.approx((end - start) * 10, abs=15)
    assert (labels[made.time < air / 0.4 - 1] == "air").all()
    assert (labels[made.time > up + hold + depth / 0.4 + 1] == "air").all()


def test_the_mean_curve_is_the_true_one_and_the_raw_data_stay():
    trials = [
        press(air=air, force_sd=0.03, displacement_sd=0.1, offset=0.2, seed=k) for k, air in enumerate((2.0, 3.7, 5.1))
    ]
    before = [r.force.copy() for r in trials]
    curve = mean_loading_curve(segment_all(trials, INSTRUMENT))
    assert curve.n_trials == 3
    assert np.diff(curve.displacement) == pytest.approx(0.25)
    assert curve.displacement[-1] == pytest.approx(20, abs=0.8)
    error = curve.force - tissue_force(curve.displacement)
    assert np.abs(error / curve.force_sd).max() < 4.0
    assert np.abs(error[8:] / curve.force[8:]).max() < 0.03
    assert all((r.force == kept).all() for r, kept in zip(trials, before, strict=True))


def test_a_trial_without_air_is_shown_with_those_with_it():
    trials = [
        press(air=air, depth=18, force_sd=0.03, displacement_sd=0.02, offset=0.3, seed=k)
        for k, air in enumerate((3.0, 0.0, 4.0))
    ]
    curve = mean_loading_curve(segment_all(trials, INSTRUMENT))
    assert [c.in_air for c in curve.contacts] == [True, False, True]
    error = curve.trial_force - tissue_force(curve.displacement)
    assert np.abs(error).max() < 0.35


def test_displacement_noise_does_not_flatten_the_curve():
    """Regressing on noisy readings at 4 samples a bin would cost several % of local slope."""
    exact, noisy = (
        mean_loading_curve(segment_all([press(displacement_sd=sd, seed=k) for k in range(6)], INSTRUMENT))
        for sd in (0.0, 0.15)
    )
    n = min(len(exact.force), len(noisy.force))
    ratio = np.polyfit(exact.force[8:n], noisy.force[8:n], 1)[0]
    assert ratio == pytest.approx(1.0, abs=0.005)
    assert exact.force == pytest.approx(tissue_force(exact.displacement), abs=2e-3)


def test_sparse_and_dense_sampling_give_the_same_curve():
    for rate in (1.0, 3.0, 500.0):
        curve = mean_loading_curve(segment_all([press(rate=rate)], INSTRUMENT))
        assert curve.force == pytest.approx(tissue_force(curve.displacement), abs=0.02)


def test_white_noise_is_recovered():
    trials = [press(force_sd=0.05, displacement_sd=0.02, seed=k) for k in range(3)]
    assert mean_loading_curve(segment_all(trials, INSTRUMENT)).white_sd == pytest.approx(0.05, rel=0.1)


def test_preconditioning_before_the_press_is_left_out():
    first = press(depth=8, unload=True, force_sd=0.02, displacement_sd=0.02)
    second = press(depth=20, force_sd=0.02, displacement_sd=0.02, seed=1)
    both = Recording(
        time=np.concatenate([first.time, second.time + first.time[-1] + 0.1]),
        displacement=np.concatenate([first.displacement, second.displacement]),
        force=np.concatenate([0.7 * first.force, second.force]),
        trial="cycled",
    )
    curve = mean_loading_curve(segment_all([both], INSTRUMENT))
    deep = curve.displacement > 9
    assert curve.force[deep] == pytest.approx(tissue_force(curve.displacement[deep]), abs=0.1)


def test_no_recordings_is_an_input_error():
    with pytest.raises(InputError, match="at least one trial"):
        mean_loading_curve([])


@pytest.mark.parametrize("law", ["neo-hookean", "reduced-polynomial"])
def test_the_crosscheck_curves_are_met(law):
    folder = CROSSCHECK / law
    subject = load_subject(folder)
    curve = mean_loading_curve(subject.trials)
    clean = pd.read_csv(folder / "clean.csv")
    truth = np.interp(curve.displacement, clean["displacement_mm"], clean["force_N"])
    assert curve.displacement[-1] == 20.0
    assert np.abs((curve.force - truth) / curve.force_sd).max() < 3.0
    weight = truth / curve.force_sd**2
    assert (weight @ curve.force) / (weight @ truth) == pytest.approx(1.0, abs=0.005)
    assert all(c.displacement == 0.0 for c in curve.contacts)

"""Courses of specimens' recordings: creep, relaxation, returns, and where they end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from making_specimens import BAR, BRANCHES, PLANTED, compressed, crept, ramp, record, relaxing

import legfem as lf
from legfem.data import Recording, Scales, quality_of, segment, write_recording
from legfem.inverse.estimates import Estimate
from legfem.mechanics.materials import NeoHookean, ReducedPolynomial
from legfem.specimens.course import borne, branch_ratios, clock, course_of, read_specimen
from legfem.specimens.details import compared, rms_percent
from legfem.specimens.nuisances import OnsetEffect
from studies.making import recording as lab


def test_the_memory_is_that_of_branches_walked_step_by_step() -> None:
    time, d = ramp(3.0, 6.0, hold=20.0)
    branch = branch_ratios(np.array([[2.0, 4.0, 0.05]]))[0]
    from legfem.mechanisms.time_dependence import TIMES_S

    elastic = d**1.5
    walked = relaxing(elastic, time, list(zip(branch, TIMES_S, strict=True)))
    kept = branch @ borne(time[1:], elastic[1:])
    np.testing.assert_allclose(elastic[1:] + kept, walked[1:], rtol=1e-10)


def test_a_clock_runs_by_the_displacement() -> None:
    time, d = ramp(3.0, 6.0, hold=20.0)
    each = clock(time[1:], d[1:] / 3.0, np.array([0.0, 1.5]))
    np.testing.assert_allclose(each[0], time[1:], rtol=1e-12)
    full = np.flatnonzero(d[1:] == 3.0)
    assert each[1, full[0]] == pytest.approx(6.0 * (np.exp(1.5) - 1) / 1.5, rel=1e-6)
    held = each[1, full[-1]] - each[1, full[0]]
    assert held == pytest.approx(np.exp(1.5) * (time[1:][full[-1]] - time[1:][full[0]]))


SHORT = ((1.2, 0.3), (0.8, 3.0), (0.4, 20.0))


def _under_force(duration: float, newtons: float, held: float) -> Recording:
    time = np.concatenate([np.linspace(0, duration, 121), np.arange(duration + 0.5, held, 0.5)])
    force = newtons * np.minimum(time / duration, 1.0)
    return Recording(time, crept(PLANTED, force, time, SHORT), force, "crept")


def test_a_held_force_is_seen_as_creep_and_a_plateau_is_not() -> None:
    creep = course_of(read_specimen(_under_force(2.0, 1.5, 120.0), None, True))
    assert creep.creeps and creep.holds
    time, d = ramp(3.0, 6.0)
    foam = Recording(time, d, 2 * np.minimum(d, 1.0), "foam")
    assert not course_of(read_specimen(foam, None, True)).holds
    plain = Recording(time, d, compressed(PLANTED, d), "plain")
    assert not course_of(read_specimen(plain, None, True)).creeps


@pytest.mark.slow
def test_a_law_is_found_from_creep_under_held_forces(tmp_path: Path) -> None:
    """The recorded motion is imposed, and the force that it asks for compared."""
    for name, duration, newtons in (("low", 2.0, 1.0), ("high", 8.0, 2.0)):
        made = _under_force(duration, newtons, 200.0)
        record(tmp_path, name, made.time, made.displacement, made.force)
    (tmp_path / "specimen.toml").write_text(BAR)
    folder = lf.load_specimen(tmp_path)
    assert folder.relaxes
    found = lf.identify(folder, "reduced-polynomial")["reduced-polynomial"]
    print({name: value.value for name, value in found.estimates.items()}, rms_percent(found))
    assert rms_percent(found) < 1.0
    assert found.estimates["deep.C10"].value == pytest.approx(5e-3, rel=0.1)
    assert found.estimates["viscoelasticity.ratio"].value == pytest.approx(2.4, rel=0.2)


SOFT = NeoHookean(0.83e-3, 1.2)


def _held(folder: Path, *factors: float) -> Path:
    """Write presses of a soft, elastic bar at one speed with holds of 10 s, their forces times factors."""
    time, d = ramp(3.0, 15.0, hold=10.0)
    for number, factor in enumerate(factors):
        record(folder, f"press{number + 1}", time, d, factor * compressed(SOFT, d))
    (folder / "specimen.toml").write_text(BAR)
    return folder


def test_what_does_not_relax_in_a_hold_is_as_stiff_as_it_is(tmp_path: Path) -> None:
    """Of relaxation slower than the test nothing is known; a law is never left worse than its limit is."""
    found = lf.identify(_held(tmp_path, 1.0, 1.0, 1.0))
    limit, stiffening = found["neo-hookean"], found["reduced-polynomial"]
    low, high = limit.estimates["deep.C10"].ci95
    print(low, high, limit.cost.minimised_value, stiffening.cost.minimised_value)
    assert low < SOFT.C10 < high and high < 1.15 * low
    assert stiffening.cost.minimised_value < 1.05 * limit.cost.minimised_value


@pytest.mark.parametrize(
    ("factors", "kinds"),
    [((1.0, 0.99, 1.01), []), ((1.0, 0.85, 0.72), ["trials that soften"]), ((1.0, 1.4, 1.0), ["trials that differ"])],
)
def test_presses_of_a_specimen_that_are_no_repeats_are_doubted(tmp_path: Path, factors, kinds) -> None:
    assert [one.kind for one in lf.load_specimen(_held(tmp_path, *factors)).doubts] == kinds


def test_what_softens_leads_a_page_that_knows_no_stiffness(tmp_path: Path) -> None:
    found = lf.identify(_held(tmp_path, 1.0, 0.85, 0.72), "neo-hookean")["neo-hookean"]
    assert found.estimates["deep.C10"].undetermined
    assert found.doubts == 1


def _with_air(folder: Path, seed: int) -> Estimate:
    """Return C10 of bars recorded with up to 2 mm of air, gains of 1 % and a lab's errors."""
    d = np.linspace(0.0, 3.0, 201)
    true = lab.Course(d / 0.2, d, compressed(PLANTED, d))
    errors = lab.LabErrors(gain_sd=0.01, air=2.0)
    made = lab.record([true] * (1 if seed % 2 else 3), errors, np.random.default_rng(seed))
    (folder / "recordings").mkdir(parents=True)
    for number, one in enumerate(made):
        write_recording(one, folder / "recordings" / f"trial{number}.csv")
    toml = BAR.replace("[recordings]\nstarts_at_contact = true\n", "")
    stated = "[instrument]\nforce_sd_N = 0.03\ndisplacement_sd_mm = 0.02\n"
    (folder / "specimen.toml").write_text(toml + stated)
    law = "reduced-polynomial"
    return lf.identify(lf.load_specimen(folder), law)[law].estimates["deep.C10"]


@pytest.mark.parametrize("seed", [19, 20, 27])
def test_first_contact_is_found_with_the_law(tmp_path: Path, seed: int) -> None:
    """By itself it is found too late, and C10 is some 30 % too high."""
    found = _with_air(tmp_path, seed)
    assert found.value == pytest.approx(5e-3, rel=0.2)
    assert found.ci95[0] < 5e-3 < found.ci95[1]


@pytest.mark.slow
def test_intervals_hold_where_recordings_begin_in_air(tmp_path: Path) -> None:
    found = [_with_air(tmp_path / str(seed), seed) for seed in range(48)]
    held = sum(one.ci95[0] < 5e-3 < one.ci95[1] for one in found)
    departures = np.array([one.value / 5e-3 - 1 for one in found])
    half = np.median([(one.ci95[1] - one.ci95[0]) / 2 / 5e-3 for one in found])
    print(f"C10 within its interval in {held} of {len(found)}, half of it {half:.3f} of C10")
    print(f"C10's error: mean {departures.mean():.3f}, rms {departures.std():.3f}")
    assert held >= 44
    assert abs(departures.mean()) < 0.03 and half < 0.2


def _onset(sd: float = 0.2) -> OnsetEffect:
    return OnsetEffect(np.linspace(1.0, 3.0, 12), sd, zero_sd=0.05, ahead=0.3)


def test_an_onset_leaves_contact_and_zero_open_in_the_weights() -> None:
    onset = _onset()
    slope, zero = onset.slope, np.full(12, 0.05)
    covariance = 0.01 * np.eye(12) + 0.04 * np.outer(slope, slope) + np.outer(zero, zero)
    np.testing.assert_allclose(onset.weighing(0.1), covariance, rtol=1e-12)


def test_what_is_left_moves_contact_to_where_the_prior_and_it_agree() -> None:
    """Contact 0.3 mm ahead already, and truly 0.1 mm farther: the prior draws it back a little."""
    onset = _onset()
    left = -0.1 * onset.slope
    shares = np.linalg.solve(1e-8 * np.eye(12) + onset.modes @ onset.modes.T, left - onset.ahead * onset.slope)
    assert onset.moved(left, onset.weighing(1e-4)) == pytest.approx(-0.2 * onset.modes[:, 0] @ shares)
    assert onset.moved(left, onset.weighing(1e-4)) == pytest.approx(0.4, rel=1e-3)
    assert 0.0 < onset.moved(left, onset.weighing(3.0)) < 0.4
    assert _onset(sd=0.0).moved(left, onset.weighing(1e-4)) == 0.0


def test_one_sample_that_overshoots_changes_nothing() -> None:
    time, d = ramp(3.0, 6.0, hold=20.0)
    force = relaxing(d**1.5, time)
    jumped = d.copy()
    jumped[100] += 4.0
    plain, other = (course_of(read_specimen(Recording(time, x, force, "a"), None, True)) for x in (d, jumped))
    assert plain.holds and plain.depth == pytest.approx(3.0)
    assert other.arrival == pytest.approx(plain.arrival)
    assert other.depth == pytest.approx(plain.depth)
    at = np.interp(plain.time, other.time, other.displacement)
    np.testing.assert_allclose(at, plain.displacement, atol=0.03)


def test_a_course_ends_at_the_first_return_and_begins_at_contact() -> None:
    time = np.arange(0.0, 20.0, 0.02)
    d = np.interp(time, [0, 5, 6, 11, 20], [0, 5, 5, 1.5, 1.5])
    force = 0.8 * np.maximum(d - 1.0, 0.0) ** 1.2 + np.random.default_rng(0).normal(0, 1e-3, 1000)
    course = course_of(read_specimen(Recording(time, d, force, "a")))
    assert course.in_air
    assert course.depth == pytest.approx(4.0, abs=0.15)
    assert course.arrival == pytest.approx(4.0, abs=0.15)
    assert course.time[-1] < 5.2
    assert course.count.sum() == len(course.samples)


def _cycled(folder: Path, returns: bool, branches=BRANCHES[:2]) -> Path:
    """Write loading, hold, a partial return, loading again and a return, at three rates."""
    law = ReducedPolynomial(4e-3, 1.0, C20=4e-3)
    for name, pace in (("fast", 0.4), ("middle", 2.0), ("slow", 10.0)):
        time = np.arange(0.0, 12.0 * pace, 0.02 * pace)
        d = np.interp(time / pace, [0, 3, 5, 6.5, 9, 12], [0, 3, 3, 1.8, 3, 0])
        record(folder, name, time, d, relaxing(compressed(law, d), time, branches))
    more = "[tissue]\nreturns = true\n" if returns else ""
    (folder / "specimen.toml").write_text(BAR + more)
    return folder


def test_a_course_goes_on_through_returns_until_the_force_is_gone(tmp_path: Path) -> None:
    whole = lf.load_specimen(_cycled(tmp_path, returns=True)).named("fast")[0].course
    first = lf.load_specimen(_cycled(tmp_path, returns=False)).named("fast")[0].course
    assert whole.arrival == pytest.approx(first.arrival) and whole.depth == first.depth
    # The partial return's turn is at 6.5 of 12 parts, and the last force is near the end.
    assert first.time[-1] < 5.2 * 0.4 and 9.5 * 0.4 < whole.time[-1] < 12 * 0.4
    assert whole.force[-1] < 0.1 * whole.peak
    turn = np.argmin(np.abs(whole.time - 6.5 * 0.4))
    assert whole.displacement[turn] == pytest.approx(1.8, abs=0.1)
    np.testing.assert_allclose(whole.force[: len(first.force) - 2], first.force[:-2])


@pytest.mark.slow
def test_cycles_are_predicted_as_they_were_driven(tmp_path: Path) -> None:
    folder = lf.load_specimen(_cycled(tmp_path, returns=True))
    found = lf.identify(folder, "reduced-polynomial", leave_out=["middle"])["reduced-polynomial"]
    (predicted,) = (one for one in compared(found) if not one.fitted)
    print(predicted.force.r_squared, {n: e.value for n, e in found.estimates.items()})
    assert predicted.force.r_squared > 0.995
    assert found.estimates["deep.C10"].value == pytest.approx(4e-3, rel=0.1)


def test_contact_noise_and_holds_are_judged_by_the_test_s_own_travel_and_force() -> None:
    """A chip of 1.8 mm travel and 0.04 N: a leg's 1 mm of smoothing and 0.05 N of rise would hide all of it."""
    time = np.arange(0.0, 60.0, 0.05)
    d = np.interp(time, [0.0, 12.0, 36.0, 60.0], [0.0, 0.62, 0.62, 1.8])
    force = 0.03 * np.maximum(d - 0.14, 0.0) + 4e-5 * np.random.default_rng(5).normal(size=len(time))
    made = Recording(time, d, force, "chip")
    trial = read_specimen(made)
    assert trial.contact.in_air and trial.contact.displacement == pytest.approx(0.14, abs=0.01)
    quality = quality_of(segment(made, scales=Scales.of_specimen(made)))
    assert quality.grade == "A"
    hold = next(part for part in quality.trial.parts if part.phase == "hold")
    assert hold.first == pytest.approx(0.62, abs=0.01) and hold.start == pytest.approx(12.0, abs=0.5)
    assert quality_of(segment(made)).grade == "D"


@pytest.mark.parametrize("power", [1.0, 1.5, 2.0])
def test_contact_is_within_its_error_whatever_power_the_force_begins_with(power: float) -> None:
    """Under a flat punch, a ball and a cone, each after a tenth of the travel in air."""
    departures = []
    for travel, seed in ((1.1, 1), (4.0, 2), (9.0, 3)):
        time = np.linspace(0.0, 8.0, 500)
        d = travel * time / 8.0
        pressed = np.maximum(d / travel - 0.1, 0.0) ** power
        force = 0.7 * pressed + 4e-4 * np.random.default_rng(seed).normal(size=500)
        contact = read_specimen(Recording(time, d, force, "a")).contact
        expected, sd = contact.expected
        departures.append((expected - 0.1 * travel) / max(sd, 1e-9))
    assert np.abs(departures).max() < 3.5

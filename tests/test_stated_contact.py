"""First contact that is stated to be at zero, and what the rig yields: known as is usual, or as the folder says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from making import write_subject
from making_diagnosis import observations, ramps
from making_identification import DEPTH, AnalyticLeg, identify, pressed_leg

from legfem.data.contact import FELT
from legfem.inverse.accuracy import Accuracy
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.estimates import Estimate
from legfem.inverse.linearised import of_recording
from legfem.inverse.observations import observe
from legfem.inverse.predictor import LATEST_ALIKE_MM, contact_sd_alike
from legfem.legs.loading import load_subject
from legfem.legs.nuisances import accuracy_of_shape
from legfem.legs.subject import LegAccuracy, Subject

C10, C20, NOISE = 0.8, 1.0, 0.1
RATE, ROUGH = 0.4, 0.5


def begun_late(leg: Subject, way: float, **known: float) -> Subject:
    """Return a leg whose recordings begin a way (mm) after first contact, and say that they begin there."""
    trials = []
    for one in leg.recordings:
        late = one.part(slice(int(np.argmax(one.displacement > way)), None))
        time, displacement = late.time - late.time[0], late.displacement - way
        trials.append(replace(late, time=time, displacement=displacement))
    return replace(leg, recordings=tuple(trials), starts_at_contact=True, accuracy=LegAccuracy(**known))


def begun_in_air(leg: Subject, way: float, seed: int) -> Subject:
    """Return a leg whose recordings begin a way (mm) before first contact, and say nothing of it."""
    rng, trials = np.random.default_rng(seed), []
    time = np.arange(0.0, way / RATE, 0.1)
    for one in leg.recordings:
        d, force = RATE * time + 0.02 * rng.standard_normal(len(time)), ROUGH * rng.standard_normal(len(time))
        every = [np.concatenate(pair) for pair in ((time, time[-1] + 0.1 + one.time), (d, way + one.displacement))]
        trials.append(replace(one, time=every[0], displacement=every[1], force=np.concatenate([force, one.force])))
    return replace(leg, recordings=tuple(trials), starts_at_contact=False)


def estimates_of(leg: Subject) -> Mapping[str, Estimate]:
    """Return what is found."""
    return identify(leg, model=AnalyticLeg(depth=DEPTH + 5.0), laws=("reduced-polynomial",))[0].estimates


def c10_of(leg: Subject) -> Estimate:
    """Return the C10 that is found."""
    return estimates_of(leg)[DEEP_C10]


def holds(found: Estimate, planted: float = C10) -> bool:
    """Whether the interval has what was planted (kPa)."""
    low, high = found.ci95
    return low <= 1e-3 * planted <= high


def test_presses_begun_late_hold_c10_where_touch_is_as_the_load_cell_feels_it(tmp_path):
    rng = np.random.default_rng(5)
    ways = rng.uniform(0.3, 0.9, 8)
    legs = [pressed_leg(tmp_path, C10, C20, seed, noise=NOISE) for seed in range(len(ways))]
    known = [c10_of(begun_late(leg, way, contact_sd=0.0)) for leg, way in zip(legs, ways, strict=True)]
    felt = [c10_of(begun_late(leg, way)) for leg, way in zip(legs, ways, strict=True)]
    assert sum(map(holds, felt)) >= len(ways) - 1
    assert sum(map(holds, known)) <= 2


def test_presses_through_air_that_a_rough_load_cell_hardly_shows_hold_c10(tmp_path):
    ways = np.random.default_rng(6).uniform(1.5, 3.5, 6)
    legs = [begun_in_air(pressed_leg(tmp_path, C10, C20, k, noise=ROUGH), way, k) for k, way in enumerate(ways)]
    assert not all(observe(one.trials).shows_air for one in legs)
    found = [c10_of(one) for one in legs]
    assert sum(map(holds, found)) >= len(ways) - 1


def test_what_a_lab_says_of_its_touch_is_taken(tmp_path):
    leg = pressed_leg(tmp_path, C10, C20, 1, noise=NOISE)
    widths = [float(np.ptp(c10_of(begun_late(leg, 0.0, contact_sd=sd)).ci95)) for sd in (0.0, 0.1, 0.3)]
    assert widths == sorted(widths) and widths[-1] > 1.2 * widths[0]


@pytest.mark.parametrize(("slope", "felt"), [(0.2, FELT * NOISE / 0.2), (0.05, LATEST_ALIKE_MM)])
def test_an_uncertain_touch_shifts_all_readings_along_the_displacement(slope, felt):
    blank = observations(ramps())[0]
    observed = replace(blank.with_force(slope * blank.displacement), white_sd=NOISE)
    assert contact_sd_alike(observed) == pytest.approx(felt / np.sqrt(12.0), rel=1e-6)
    (one,) = of_recording(observed, Accuracy(contact_sd=None))
    np.testing.assert_allclose(one.effect, felt / np.sqrt(12.0) * slope, rtol=1e-6)
    (stated,) = of_recording(observed, Accuracy(contact_sd=0.1))
    np.testing.assert_allclose(stated.effect, 0.1 * slope, rtol=1e-6)
    unstated = replace(observed, starts_at_contact=False)
    (less,) = of_recording(unstated, Accuracy(contact_sd=None))
    np.testing.assert_allclose(less.effect, np.sqrt(1 - unstated.chance_of_air) * one.effect)


def test_the_key_says_nothing_of_the_leg_itself(tmp_path):
    folder = write_subject(tmp_path)
    toml = folder / "subject.toml"
    toml.write_text(f"{toml.read_text()}\n[accuracy]\ncontact_sd_mm = 0.2\n")
    subject = load_subject(folder, need_recordings=False)
    assert subject.accuracy == LegAccuracy(contact_sd=0.2) and not subject.accuracy.stated
    without = accuracy_of_shape(replace(subject, accuracy=LegAccuracy()))
    assert accuracy_of_shape(subject) == replace(without, contact_sd=0.2)
    assert without.contact_sd is None and Accuracy().contact_sd == 0.0
    assert accuracy_of_shape(replace(subject, typical_shape=True)).contact_sd == 0.2


def on_a_rig_that_yields(leg: Subject, compliance: float, **known: float) -> Subject:
    """Return a leg whose recorded displacements hold what the rig yields (mm/N)."""
    trials = tuple(replace(one, displacement=one.displacement + compliance * one.force) for one in leg.recordings)
    return replace(leg, recordings=trials, accuracy=LegAccuracy(contact_sd=0.0, **known))


def test_a_rig_that_yields_holds_c10_and_c20_unless_it_is_said_to_be_stiff(tmp_path):
    yields = np.random.default_rng(8).uniform(0.01, 0.05, 8)
    legs = [pressed_leg(tmp_path, C10, C20, seed, noise=NOISE) for seed in range(len(yields))]
    held = []
    for said in ({}, {"rig_sd": 0.0}):
        every = [on_a_rig_that_yields(leg, one, **said) for leg, one in zip(legs, yields, strict=True)]
        found = [estimates_of(leg) for leg in every]
        held.append((sum(holds(one[DEEP_C10]) for one in found), sum(holds(one[DEEP_C20], C20) for one in found)))
    (c10, c20), (_, stiff) = held
    assert min(c10, c20) >= len(legs) - 1 and stiff <= 1

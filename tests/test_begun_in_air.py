"""Sound repeats that begin in air by different ways: not called a misfit, and C10 within its interval."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from making_identification import DEPTH, curve_of, identify, pressed_leg

from legfem.data import Instrument, Recording, mean_loading_curve, segment_all
from studies.making.recording import INSTRUMENT, Course, LabErrors, record

DRAWS, RATE, PRESSED = 16, 0.5, DEPTH - 2.0
NOISY = Instrument(force_sd=0.25, displacement_sd=0.02)


def test_sound_repeats_with_different_ways_of_air_are_not_refused(tmp_path: Path) -> None:
    time = np.arange(0.0, PRESSED / RATE, 0.1)
    refused, held, errors, seen = 0, 0, [], []
    for seed in range(DRAWS):
        generator = np.random.default_rng([seed, 37])
        c10 = float(generator.uniform(0.3, 0.9))
        course = Course(time, RATE * time, curve_of(c10, 0.0)(RATE * time))
        # Enough air for one of them to show it.
        recordings = tuple(record([course], LabErrors(0.01, air), generator)[0] for air in (3.5, 1.5, 1.5))
        leg = replace(pressed_leg(tmp_path, c10, 0.0), recordings=recordings, instrument=INSTRUMENT)
        (fit,) = identify(leg, laws=("neo-hookean",))
        found = fit.estimates["deep.C10"].shown
        refused += not fit.goodness.fits
        held += found.ci95[0] <= c10 <= found.ci95[1]
        errors.append(np.log(found.value / c10))
        seen.append(sum(one.contact.in_air for one in leg.trials))
    print(f"{refused} of {DRAWS} refused, {held} held, {np.mean(errors):+.3f} +- {np.std(errors):.3f}; air seen {seen}")
    assert seen.count(1) >= DRAWS // 4
    assert refused <= 1
    assert held >= 0.85 * DRAWS
    assert abs(np.mean(errors)) < 0.02
    assert np.std(errors) < 0.03


def test_a_load_cell_that_wanders_through_much_air_is_not_taken_for_the_leg() -> None:
    time = np.arange(0.0, 28.0, 0.1)
    for seed in range(24):
        generator = np.random.default_rng([seed, 40])
        travel = RATE * time
        course = Course(time, travel, generator.uniform(0.1, 0.3) * (travel + 0.05 * travel**2))
        trials = segment_all(record([course] * 3, LabErrors(0.01, 12.0), generator), INSTRUMENT)
        assert abs(mean_loading_curve(trials).displacement[-1] - travel[-1]) < 0.8, seed


@pytest.mark.parametrize("air", [(0.3, 1.3, 2.4), (0.0, 0.0, 0.0)])
def test_a_noisy_cell_hides_the_air_of_every_repeat_and_c10_is_within_its_interval(tmp_path: Path, air) -> None:
    c10, seeds, held = 0.6, (0, 6, 12), 0
    for seed in seeds:
        generator = np.random.default_rng([seed, 41])
        recordings = []
        for number, (gap, zero) in enumerate(zip(air, (0.1, -0.05, -0.1), strict=True)):
            time = np.arange(0.0, (PRESSED + gap) / RATE, 0.1)
            travel = RATE * time
            force = curve_of(c10, 0.0)(np.maximum(travel - gap, 0.0)) + zero
            noisy = (one + sd * generator.standard_normal(len(time)) for one, sd in ((travel, 0.02), (force, 0.25)))
            recordings.append(Recording(time, *noisy, f"trial{number + 1}"))
        leg = replace(pressed_leg(tmp_path, c10, 0.0), recordings=tuple(recordings), instrument=NOISY)
        assert not any(one.contact.in_air for one in leg.trials)
        (fit,) = identify(leg, laws=("neo-hookean",))
        low, high = fit.estimates["deep.C10"].shown.ci95
        held += low <= c10 <= high
        print(air, seed, low, high)
    assert held == len(seeds)

"""Sound repeats that begin in air by different ways: not called a misfit, and C10 within its interval."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from making_identification import DEPTH, curve_of, identify, pressed_leg

from legfem.data import segment_all
from legfem.data.alignment import align_branches, loading_branch
from studies.making.recording import INSTRUMENT, Course, LabErrors, record

DRAWS, RATE, PRESSED = 16, 0.5, DEPTH - 2.0


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
        found = align_branches([loading_branch(one) for one in trials], [one.contact for one in trials], INSTRUMENT)
        deepest = [float(one.depth[-1]) for one in found.branches]
        assert abs(np.mean(deepest) - travel[-1]) < 0.8, seed

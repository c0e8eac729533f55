"""A press is found by its force as well as by its displacement: bounces, tears, preloads and returns are said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from making_specimens import BAR, compressed

import legfem as lf
from legfem.data import Recording, Scales, quality_of, segment, write_recording
from legfem.data.columns import propose
from legfem.data.formats import read_sheets
from legfem.data.phases import before_tear
from legfem.mechanics.materials import NeoHookean
from legfem.specimens.course import course_of, read_specimen

C10 = 5e-3
LAW = NeoHookean(C10, 1.0)
PULL = BAR.replace("compression", "tension")


def noisy(time: np.ndarray, d: np.ndarray, force: np.ndarray, seed: int = 1) -> Recording:
    return Recording(time, d, force + np.random.default_rng(seed).normal(0.0, 2e-3, len(time)), "a")


def folder_of(folder: Path, recording: Recording, toml: str) -> lf.SpecimenFolder:
    (folder / "recordings").mkdir(parents=True)
    write_recording(recording, folder / "recordings" / "a.csv")
    (folder / "specimen.toml").write_text(toml)
    return lf.load_specimen(folder)


@pytest.mark.parametrize(("place", "by"), [(2.0, 0.15), (2.6, 0.4), (2.9, 1.2)])
def test_a_drive_that_bounces_in_the_air_is_not_drawn_back(place: float, by: float) -> None:
    """Of 3 mm of air before a press of 3 mm."""
    time = np.arange(0, 12, 0.02)
    d = np.interp(time, [0, 2.0, 2.1, 2.2, 6.2, 12], [0, place, place - by, place, 6.0, 6.0])
    course = course_of(read_specimen(noisy(time, d, compressed(LAW, np.maximum(d - 3.0, 0.0)))))
    assert course.contact.displacement == pytest.approx(3.0, abs=0.05)
    assert course.depth == pytest.approx(3.0, abs=0.05)
    assert course.peak == pytest.approx(float(compressed(LAW, np.array(3.0))), rel=0.02)


def test_a_press_that_ends_is_still_one_where_a_second_follows() -> None:
    time = np.arange(0, 20, 0.02)
    d = np.interp(time, [0, 4, 8, 12, 16, 20], [0, 2, 0, 3, 0, 0])
    assert course_of(read_specimen(noisy(time, d, compressed(LAW, d)), None, True)).depth == pytest.approx(2, abs=0.05)


def pulled(at: float = 3.5, ends: float = -0.02, left: float = 0.15, preload: float = 0.0) -> Recording:
    """A bar that tears at a displacement and then bears a share of its force, on its way to another one."""
    time = np.arange(0, 10, 0.02)
    d = 0.5 * time
    force = compressed(LAW, d, 1.0) + preload
    after = left * force.max() * np.exp(-(d - at) / 0.2) + ends
    return noisy(time, d, np.where(d < at, force, after))


@pytest.mark.parametrize("ends", [0.05, -0.3, -1.5])
def test_what_is_pulled_to_failure_counts_up_to_where_it_tears(tmp_path: Path, ends: float) -> None:
    made = pulled(ends=ends)
    folder = folder_of(tmp_path / "bar", made, PULL)
    found = lf.identify(folder, "neo-hookean")
    estimate = found["neo-hookean"].estimates["deep.C10"]
    assert estimate.ci95[0] < C10 < estimate.ci95[1] and estimate.value == pytest.approx(C10, rel=0.02)
    said = " ".join(found.summary().split())
    assert "a is used to 3.49 mm: there its force falls by more than a quarter" in said


@pytest.mark.parametrize("ends", [0.05, -0.3, -1.5])
def test_a_pull_to_failure_is_not_a_press_upside_down(tmp_path: Path, ends: float) -> None:
    made = pulled(ends=ends)
    path = tmp_path / "a.csv"
    rows = np.column_stack([made.time, made.displacement, made.force])
    np.savetxt(path, rows, delimiter=",", header="Time (s),Extension (mm),Load (N)", comments="")
    assert propose(path, read_sheets(path)).channels.force.sign == 1
    quality = quality_of(segment(made, scales=Scales.of_specimen(made)))
    assert quality.grade == "B" and "tears, or slips, at 3.49 mm" in " ".join(quality.reasons)


def test_what_relaxes_or_yields_a_little_does_not_tear() -> None:
    """A ramp that is held, one that goes on a tenth as fast, a foam's plateau, and a drop by a seventh."""
    time = np.arange(0, 30, 0.02)
    fast = np.interp(time, [0, 2, 30], [0, 2.0, 4.0])
    held = np.interp(time, [0, 2, 30], [0, 2.0, 2.0])
    relaxing = np.interp(time, [0, 2, 4, 30], [0, 1.0, 0.55, 0.5])
    d = 0.1 * time
    foam = np.minimum(d, 1.0) - 0.14 * (d > 2.0)
    for way, force in ((fast, relaxing), (held, relaxing), (d, foam)):
        made = noisy(time, way, force)
        assert before_tear(time, way, made.force) == len(time)


def test_a_preload_of_a_few_per_cent_is_said_and_in_the_interval(tmp_path: Path) -> None:
    time = np.arange(0, 8, 0.02)
    d = 0.5 * time
    made = noisy(time, d, compressed(LAW, d + 0.3))
    assert 0.03 < made.force[:5].mean() / np.ptp(made.force) < 0.05
    found = lf.identify(folder_of(tmp_path / "bar", made, BAR), "neo-hookean")
    estimate = found["neo-hookean"].estimates["deep.C10"]
    assert estimate.ci95[0] < C10 < estimate.ci95[1] and found["neo-hookean"].goodness.fits
    assert "N before anything is pressed: a preload, or a zero" in " ".join(found.summary().split())


TABLE = """\
id = "gel"
title = "A table with its way back"
origin = "measured"

[uniaxial]
direction = "tension"

[recordings.table]
stretch = "stretch"
stress = "stress"
unit = "kPa"
measure = "nominal"
"""


def table(folder: Path, scatter: float = 0.02) -> lf.SpecimenFolder:
    """Write stretch and stress up and back, a fifth of the work lost; the law stiffens, so neo-Hookean misses it."""
    stretch = np.concatenate([np.linspace(1, 1.5, 60), np.linspace(1.5, 1.0, 60)[1:]])
    stress = 1e3 * 2 * (C10 + 6e-3 * (stretch**2 + 2 / stretch - 3)) * (stretch - stretch**-2)
    back = np.arange(len(stretch)) >= 60
    stress = np.where(back, stress * (1 - 0.3 * np.sin(np.pi * (stretch - 1) / 0.5)), stress)
    stress += np.random.default_rng(2).normal(0, scatter, len(stress))
    (folder / "recordings").mkdir(parents=True)
    rows = np.column_stack([stretch, stress])
    np.savetxt(folder / "recordings" / "a.csv", rows, delimiter=",", header="stretch,stress (kPa)", comments="")
    (folder / "specimen.toml").write_text(TABLE)
    return lf.load_specimen(folder)


def test_the_hysteresis_of_a_table_is_said_and_is_no_noise(tmp_path: Path) -> None:
    folder = table(tmp_path / "gel")
    (one,) = folder.recordings
    assert one.recording.hysteresis == pytest.approx(0.18, abs=0.03)
    assert len(one.recording) < 65
    # 0.02 kPa on 100 mm2 are 2 mN, and a least share of the range counts.
    assert one.course.instrument.force_sd < 6e-3
    found = lf.identify(folder, "neo-hookean")
    assert not found["neo-hookean"].goodness.fits
    said = " ".join(found.summary().split())
    assert "The return of a is left out" in said and "(hysteresis)" in said
    assert "Problems found: None" not in said

"""Readings that can't have been, told from those that only look odd."""

from __future__ import annotations

import re
import shutil
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from making import press, write_subject
from making_sites import write_sites
from making_specimens import write_bars

from legfem.common.errors import InputError
from legfem.data import Instrument, Recording, read_samples, segment
from legfem.data.plausibility import cut_off, magnitude_doubts, trial_doubts
from legfem.geometry.section import LegSection
from legfem.geometry.section_from_outlines import polygons_of
from legfem.legs.loading import load_sites, load_subject
from legfem.legs.plausibility import doubts_about
from legfem.mechanics.materials import NeoHookean
from legfem.specimens.folder import load_specimen

DEPTH, NOISE = 20.0, 0.02


def pressed(seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a stiffening leg's way (mm) and force (N), at 10 Hz and 0.4 mm/s, and its noise."""
    d = np.linspace(0.0, DEPTH, 500)
    noise = NOISE * np.random.default_rng(seed).standard_normal(len(d))
    return d, 0.15 * d * (1 + 0.03 * d), noise


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("way", [1.0, 3.0, 9.0])
def test_a_force_that_is_cut_off_is_seen_with_the_noise_of_what_comes_after(way, seed):
    d, force, noise = pressed(seed)
    limit = np.interp(DEPTH - way, d, force)
    found = cut_off(d, np.minimum(force, limit) + noise)
    assert 0.5 * way < found < 1.5 * way
    assert cut_off(d, np.minimum(force + noise, limit)) > 0.5 * way, "exactly level, too"


@pytest.mark.parametrize("seed", range(5))
def test_what_eases_drops_or_waves_is_not_cut_off(seed):
    d, force, noise = pressed(seed)
    eased = np.where(d > 15.0, np.interp(15.0, d, force) + 0.3 * (force - force[375]), force)
    dropped = force - 0.3 * (d > 17.0)
    waving = force + 0.1 * np.sin(2 * np.pi * d / 3.0)
    for one in (force, eased, dropped, waving):
        assert cut_off(d, one + noise) == 0.0


def test_noise_alone_and_a_standing_drive_are_not_cut_off():
    _, _, noise = pressed()
    assert cut_off(np.linspace(0.0, DEPTH, 500), noise) == 0.0
    still = np.concatenate([np.linspace(0.0, DEPTH, 50), np.full(450, DEPTH)])
    assert cut_off(still, np.interp(still, [0.0, DEPTH], [0.0, 5.0]) + noise) == 0.0


def test_one_value_to_the_last_digit_is_seen_in_few_samples_too():
    d = np.linspace(0.0, DEPTH, 25)
    force = 0.15 * d * (1 + 0.03 * d)
    assert cut_off(d, np.minimum(force, 0.7 * force[-1])) > 0.1 * DEPTH
    assert cut_off(d, np.minimum(force, force[-2])) == 0.0, "two alike may be chance"


def doubted(made: Recording, starts_at_contact: bool = False) -> list[str]:
    trial = segment(made, Instrument(0.03, 0.02), starts_at_contact)
    return [f"{doubt.field}: {doubt.problem}" for doubt in trial_doubts([trial])]


def made(**changes: float | bool) -> Recording:
    return press(force_sd=0.03, displacement_sd=0.02, seed=7, **changes)


@pytest.mark.parametrize(
    "whole",
    [made(), made(unload=True), made(air=2.5, offset=3.0, hold=30.0, unload=True), made(speed=4.0, unload=True)],
)
def test_a_recording_in_which_nothing_is_wrong_is_not_doubted(whole: Recording) -> None:
    assert doubted(whole) == []


@pytest.mark.parametrize("offset", [1.4, -2.7])
@pytest.mark.parametrize("stated", [True, False])
def test_a_force_that_stands_at_the_first_sample_is_doubted(offset: float, stated: bool) -> None:
    (line,) = doubted(made(offset=offset), stated)
    why = "a preload, or a zero that wasn't taken" if offset > 0 else "tissue doesn't pull, so the zero wasn't taken"
    assert why in line
    assert float(line.removeprefix("force_N: reads ").split()[0]) == pytest.approx(offset, abs=0.15)


def test_a_displacement_that_starts_elsewhere_than_stated_is_doubted_with_both_readings() -> None:
    one = made(depth=16.0)
    (line,) = doubted(replace(one, displacement=one.displacement + 3.4), starts_at_contact=True)
    assert line.startswith("displacement_mm: starts at 3.") and "19.4 mm deep, and would be 16 mm" in line
    assert doubted(replace(one, displacement=one.displacement + 3.4)) == []


@pytest.mark.parametrize("rate", [0.06, -0.05])
def test_a_force_that_drifts_is_doubted_by_what_is_left_where_it_began(rate: float) -> None:
    one = made(hold=12.0, unload=True)
    (line,) = doubted(replace(one, force=one.force + rate * one.time), starts_at_contact=True)
    said = re.search(r"back where it began than at first \((\S+) N/s\)", line)
    assert said and float(said[1]) == pytest.approx(rate, abs=0.005)


def test_unloading_alone_is_called_that() -> None:
    one = made(depth=16.0)
    lines = doubted(replace(one, displacement=one.displacement - 16.0, force=one.force - one.force[-20:].mean()))
    assert any("as unloading alone" in line for line in lines) and not any("preload" in line for line in lines)


@pytest.mark.parametrize("factor", [1e-3, 60.0])
def test_a_speed_at_which_no_leg_is_pressed_is_doubted(factor: float) -> None:
    one = made()
    trial = segment(replace(one, time=one.time / factor), Instrument(0.03, 0.02))
    assert any(
        "a speed of" in str(doubt) and "check that time is in s" in str(doubt) for doubt in magnitude_doubts(trial)
    )
    assert not list(magnitude_doubts(segment(one, Instrument(0.03, 0.02))))


def test_a_force_that_rises_in_a_hold_is_doubted() -> None:
    one = made(hold=40.0)
    (line,) = doubted(replace(one, force=one.force + 0.12 * one.time), starts_at_contact=True)
    assert "more at the end of a hold, where tissue relaxes, than at its start" in line and "it drifts" in line


def test_a_counter_that_is_reset_is_refused_with_its_row() -> None:
    one = made(depth=18.0)
    reset = replace(one, displacement=np.where(one.time > 30.0, one.displacement - 4.3, one.displacement))
    with pytest.raises(
        InputError, match=r"row 302 of 451: jumps from .* a sensor or a counter that was reset; add 4\."
    ):
        doubted(reset)


def test_copies_between_the_sites_of_a_leg_are_refused(tmp_path: Path) -> None:
    folder = write_sites(tmp_path / "leg")
    first, second = sorted(path for path in (folder / "recordings").iterdir() if path.is_dir())
    shutil.copy(next(first.glob("*.csv")), second / "again.csv")
    with pytest.raises(InputError, match=r"is a copy of .*trial1"):
        load_sites(folder)


@pytest.mark.parametrize(("pattern", "words"), [(".", "is not a pattern of files"), ("b\\u0000c", "control character")])
def test_a_pattern_that_names_no_files_is_one_line(tmp_path: Path, pattern: str, words: str) -> None:
    folder = write_bars(tmp_path / "bars", NeoHookean(5e-3, 1.0))
    toml = folder / "specimen.toml"
    toml.write_text(toml.read_text() + f'[[specimen]]\nname = "a"\nrecordings = ["{pattern}"]\n')
    with pytest.raises(InputError, match=rf"specimen\.toml: specimen\..*recordings.*{words}"):
        load_specimen(folder)


def test_a_section_that_is_stretched_is_doubted(tmp_path: Path) -> None:
    subject = load_subject(write_subject(tmp_path / "leg"))
    assert not [d for d in doubts_about(subject) if "one way" in d.problem]
    section = subject.section
    wide = LegSection.of_parts({name: section.contour(name) * [1.75, 1.0] for name in section.parts}, 0.6)
    lines = [str(d) for d in doubts_about(replace(subject, section=wide, recordings=()))]
    assert any("longer than any calf is wide; check the image's spacing" in line for line in lines)


def test_points_in_no_order_are_refused_at_once(tmp_path: Path) -> None:
    angle = np.random.default_rng(3).permutation(np.linspace(0, 2 * np.pi, 1500, endpoint=False))
    points = 58.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    start = time.monotonic()
    with pytest.raises(InputError, match="skin: its points are in no order"):
        polygons_of({"skin": [points]}, Path("points.csv"), "level 10 mm")
    assert time.monotonic() - start < 2.0


@pytest.mark.parametrize("change", [lambda force: -force, lambda force: force + 4.0])
def test_a_force_that_jumps_where_the_displacement_goes_on_is_doubted(change) -> None:
    one = made(hold=20.0)
    within = (one.time > 25.0) & (one.time < 29.0)
    found = doubted(replace(one, force=np.where(within, change(one.force), one.force)))
    # From 10 to 11.6 mm.
    assert any("while the displacement goes on as before" in line and " at 11.6 mm" in line for line in found)


def test_a_loading_with_a_gap_is_doubted() -> None:
    one = made()
    kept = (one.time < 15.0) | (one.time > 25.0)
    line, *_ = doubted(Recording(one.time[kept], one.displacement[kept], one.force[kept], "t"))
    assert "nothing was recorded between 14.9 and 25.1 s" in line


def test_presses_that_stand_one_behind_the_other_in_a_file_are_doubted() -> None:
    one = made()
    times = np.concatenate([one.time, one.time + one.time[-1] + 0.1])
    joined = Recording(times, np.tile(one.displacement, 2), np.tile(one.force, 2), "t")
    assert any("2 presses are in one file" in line for line in doubted(joined))


@pytest.mark.parametrize("text", ["1e300", "-1e12"])
def test_numbers_that_are_no_readings_are_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "trial.csv"
    path.write_text("time_s,displacement_mm,force_N\n" + "".join(f"{k / 10},{k / 100},{text}\n" for k in range(60)))
    with pytest.raises(InputError, match="60 numbers cannot be readings"):
        read_samples(path)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("force_sd_N = 0.04", "force_sd_N = 1e300", "is out of range; give a value of at most 1e+06, in N"),
        ('title = "Made for a test"', "title = 7", "7 is not text; write it in quotes: title = "),
        ("aim_mm = [0.0, 0.0]", "aim_mm = true", "True is not a list; write aim_mm = [...]"),
        ("aim_mm = [0.0, 0.0]", "aim_mm = [0.0]", "[0.0] has the wrong length; give 2 or more"),
        ("title =", "confirmed = [1]\ntitle =", '1 is not text; write it in quotes: "..."'),
    ],
)
def test_a_key_of_a_wrong_type_is_refused_with_how_to_write_it(tmp_path: Path, old: str, new: str, words: str) -> None:
    folder = write_subject(tmp_path / "leg")
    toml = folder / "subject.toml"
    toml.write_text(toml.read_text().replace(old, new))
    with pytest.raises(InputError) as caught:
        load_subject(folder)
    assert words in str(caught.value)

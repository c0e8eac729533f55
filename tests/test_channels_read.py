"""Channels beside the force, as a subject's folder gives them, and what is refused of them."""

from __future__ import annotations

import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from making import TOML, press, write_subject
from typer.testing import CliRunner

from legfem.channels.kinds import CHANNELS
from legfem.commands.data import app
from legfem.common.errors import InputError
from legfem.data.reader import read_samples
from legfem.data.recording import RecordedChannel, write_recording
from legfem.legs.loading import load_subject
from legfem.legs.plausibility import doubts_about
from legfem.report.preview import preview_of

AIMED = TOML.replace("aim_mm = [0.0, 0.0]", "aim_mm = [-10.0, 0.0]")
"""The line of travel meets the tibia."""
FRAMES = np.arange(0.0, 20.1, 2.5)
FAT = 6.0
USUAL = CHANNELS["fat_thickness"].usual


def fat(depth: np.ndarray) -> np.ndarray:
    return FAT - 0.12 * depth


def subject(folder: Path, columns: dict[str, np.ndarray], toml: str = AIMED) -> Path:
    """One trial; columns hold values at `FRAMES`' times, empty between them."""
    directory = write_subject(folder, toml)
    (path,) = (directory / "recordings").glob("*.csv")
    lines = path.read_text().splitlines()
    time = np.array([float(line.split(",")[0]) for line in lines[1:]])
    frames = {int(np.argmin(abs(time - at))): k for k, at in enumerate(FRAMES)}
    rows = [",".join([lines[0], *columns])]
    for row, line in enumerate(lines[1:]):
        k = frames.get(row)
        rows.append(",".join([line, *("" if k is None else f"{values[k]:.4f}" for values in columns.values())]))
    path.write_text("\n".join(rows) + "\n")
    return directory


def loaded(directory: Path, name: str) -> RecordedChannel:
    (recording,) = load_subject(directory).recordings
    return next(one for one in recording.channels if one.name == name)


def depth_of_frames() -> np.ndarray:
    recording = press()
    return np.interp(FRAMES, recording.time, recording.displacement)


def test_columns_with_empty_cells_are_channels(tmp_path):
    values = fat(depth_of_frames())
    found = loaded(subject(tmp_path / "leg", {"fat_thickness_mm": values}), "fat_thickness")
    np.testing.assert_allclose(found.values, values, atol=1e-4)
    np.testing.assert_allclose(found.time, FRAMES, atol=0.05)
    assert found.accuracy == CHANNELS["fat_thickness"].usual


def test_what_is_written_is_read_again(tmp_path):
    """Frames on a clock of their own at the nearest rows, two in one as their mean; the force as it was."""
    own = press()
    step = float(own.time[1] - own.time[0])
    frames = own.time[[20, 60, 100]] + np.array([0.2, -0.3, 0.0]) * step
    fat_values, lateral = np.array([6.0, 5.5, 5.0]), 0.05 * own.force
    twice = np.sort(np.concatenate([frames, frames + 0.1 * step]))
    channels = (
        RecordedChannel("fat_thickness", twice, np.repeat(fat_values, 2) + np.tile([0.1, -0.1], 3), USUAL),
        RecordedChannel("lateral_force", own.time, lateral, CHANNELS["lateral_force"].usual),
    )
    write_recording(replace(own, channels=channels), tmp_path / "trial1.csv")
    read = read_samples(tmp_path / "trial1.csv")
    np.testing.assert_allclose(read.force, own.force, atol=1e-4)
    found = {one.name: one for one in read.channels}
    np.testing.assert_allclose(found["fat_thickness"].values, fat_values, atol=1e-4)
    np.testing.assert_allclose(found["fat_thickness"].time, own.time[[20, 60, 100]], atol=1e-4)
    np.testing.assert_allclose(found["lateral_force"].values, lateral, atol=1e-4)


def test_a_recording_without_further_columns_has_no_channels(tmp_path):
    (recording,) = load_subject(write_subject(tmp_path / "leg")).recordings
    assert recording.channels == ()


@pytest.mark.parametrize(
    ("text", "factor"),
    [
        ("time_s,fat_thickness_mm\n{rows}", 1.0),
        ("Time (s);Fat thickness (cm)\n{rows}", 0.1),
        ("Time [ms]\tfat thickness [mm]\n{rows}", 1.0),
    ],
)
def test_a_file_of_its_own_is_read_in_its_own_units(tmp_path, text, factor):
    stated = AIMED + '[channels.fat_thickness]\nfile = "us.csv"\nsd_mm = 0.4\nlag_s = 0.3\n'
    directory = write_subject(tmp_path / "leg", stated)
    mark = next(mark for mark in (";", "\t", ",") if mark in text)
    clock = 1000.0 if "[ms]" in text else 1.0
    values = fat(depth_of_frames())
    rows = "\n".join(f"{clock * t:.6g}{mark}{factor * v:.6g}" for t, v in zip(FRAMES, values, strict=True))
    (directory / "us.csv").write_text(text.format(rows=rows) + "\n")
    found = loaded(directory, "fat_thickness")
    np.testing.assert_allclose(found.values, values, rtol=1e-5)
    np.testing.assert_allclose(found.time, FRAMES, rtol=1e-5)
    assert (found.accuracy.reading, found.accuracy.lag) == (0.4, 0.3)
    assert found.accuracy.bias == CHANNELS["fat_thickness"].usual.bias


def test_several_trials_have_a_file_each(tmp_path):
    directory = write_subject(tmp_path / "leg", AIMED + '[channels.fat_thickness]\nfile = "us.csv"\n', trials=2)
    with pytest.raises(InputError, match=re.escape("{trial}")):
        load_subject(directory)
    (directory / "subject.toml").write_text(AIMED + '[channels.fat_thickness]\nfile = "us-{trial}.csv"\n')
    for number, path in enumerate(sorted((directory / "recordings").glob("*.csv"))):
        rows = "\n".join(f"{t},{v + number}" for t, v in zip(FRAMES, fat(depth_of_frames()), strict=True))
        (directory / f"us-{path.stem}.csv").write_text(f"time_s,fat_thickness_mm\n{rows}\n")
    first, second = (one.channels[0].values for one in load_subject(directory).recordings)
    np.testing.assert_allclose(second - first, 1.0)
    for path in directory.glob("us-*.csv"):
        path.rename(directory / "recordings" / path.name)
    beside = load_subject(directory)
    assert [one.trial for one in beside.recordings] == ["trial1", "trial2"], "frames beside the recordings are none"
    np.testing.assert_array_equal(beside.recordings[1].channels[0].values, second)
    assert not any("not read" in str(doubt) for doubt in doubts_about(beside))
    assert not preview_of(directory, tmp_path).trouble


def refused(directory: Path, *words: str) -> None:
    with pytest.raises(InputError) as found:
        load_subject(directory)
    message = str(found.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message


def test_fat_that_grows_under_the_cylinder_is_refused(tmp_path):
    refused(subject(tmp_path / "leg", {"fat_thickness_mm": FAT + 0.2 * depth_of_frames()}), "fat_thickness", "grows")


def test_a_thickness_in_another_unit_is_refused(tmp_path):
    refused(subject(tmp_path / "leg", {"fat_thickness_mm": 10 * fat(depth_of_frames())}), "by what is stated", "unit")


@pytest.mark.parametrize(
    ("column", "values", "word"),
    [
        ("fat_thickness_mm", np.where(np.arange(len(FRAMES)) == 4, 1200.0, FAT), "1.2e+03 mm"),
        ("fat_thickness_mm", np.where(np.arange(len(FRAMES)) == 4, -FAT, FAT), "it is -6 mm"),
        ("fat_thickness_mm", np.where(np.arange(len(FRAMES)) == 4, 0.0, FAT), "it is 0 mm"),
        ("contact_width_mm", -FRAMES, "down to"),
        ("skin_rise_left_25_mm", -10 * FRAMES, "where the cylinder moves by"),
        ("skin_rise_left_30_mm", -0.1 * FRAMES, "'skin_rise_left_30_mm' is not expected"),
        ("axis_moment_Nm", 1e-4 * FRAMES, "'axis_moment_Nm' is not expected"),
    ],
)
def test_readings_that_no_instrument_has_and_columns_of_no_channel_are_refused(tmp_path, column, values, word):
    refused(subject(tmp_path / "leg", {column: values}), word)


@pytest.mark.parametrize(
    ("column", "factor", "values", "words"),
    [
        ("lateral_force_N", 1000.0, np.linspace(0.0, 0.2, 12), "its readings last"),
        ("lateral_force_N", 1.0, np.full(12, -0.0), "all its 12 readings are 0 N"),
        ("fat_thickness_mm", 1 / 60, np.linspace(FAT, 0.5 * FAT, 12), "where what presses moves by"),
    ],
)
def test_another_clock_and_a_sensor_that_was_not_connected_are_refused(tmp_path, column, factor, values, words):
    name = column.rpartition("_")[0]
    directory = write_subject(tmp_path / "leg", AIMED + f'[channels.{name}]\nfile = "other.csv"\n')
    rows = "\n".join(f"{factor * t},{v}" for t, v in zip(np.linspace(0.0, 20.0, 12), values, strict=True))
    (directory / "other.csv").write_text(f"time_s,{column}\n{rows}\n")
    refused(directory, words)


def test_another_layer_s_thickness_is_not_taken_for_the_fat_s(tmp_path):
    directory = write_subject(tmp_path / "leg", AIMED + '[channels.fat_thickness]\nfile = "us.csv"\n')
    rows = "\n".join(f"{t},{v}" for t, v in zip(FRAMES, fat(depth_of_frames()), strict=True))
    (directory / "us.csv").write_text(f"time_s,muscle_thickness_mm\n{rows}\n")
    refused(directory, "'muscle_thickness' in mm", "time_s,fat_thickness_mm")


def test_a_lateral_force_above_the_force_is_refused(tmp_path):
    recording = press()
    lateral = 1.5 * np.interp(FRAMES, recording.time, recording.force)
    refused(subject(tmp_path / "leg", {"lateral_force_N": lateral}), "lateral_force", "axes")


def test_a_thickness_where_no_bone_lies_ahead_is_refused(tmp_path):
    values = 70 - depth_of_frames()
    refused(subject(tmp_path / "leg", {"muscle_thickness_mm": values}, TOML), "no bone", "aim_mm")


def test_readings_at_other_times_are_refused(tmp_path):
    stated = AIMED + '[channels.fat_thickness]\nfile = "us.csv"\n'
    directory = write_subject(tmp_path / "leg", stated)
    (directory / "us.csv").write_text("time_s,fat_thickness_mm\n500,6\n501,5.9\n502,5.8\n")
    refused(directory, "none of its readings", "clock")


@pytest.mark.filterwarnings("error")
def test_a_channel_that_goes_on_beyond_its_recording_is_read_without_a_warning(tmp_path):
    directory = write_subject(tmp_path / "leg", AIMED + '[channels.fat_thickness]\nfile = "us.csv"\n')
    last = float(press().time[-1])
    times = [0.3 * last, 0.5 * last, *(last + np.arange(1.0, 40.0))]
    rows = "\n".join(f"{t},{FAT - 0.3 - 0.01 * k}" for k, t in enumerate(times))
    (directory / "us.csv").write_text(f"time_s,fat_thickness_mm\n{rows}\n")
    assert len(loaded(directory, "fat_thickness").values) == len(times)


def test_a_channel_that_is_late_is_refused(tmp_path):
    """Of a test that presses and lets go, a lag is clear."""
    directory = write_subject(tmp_path / "leg", AIMED + '[channels.fat_thickness]\nfile = "us.csv"\nsd_mm = 0.05\n')
    (path,) = (directory / "recordings").glob("*.csv")
    time = np.arange(0, 40, 0.05)
    depth = np.minimum(time, 40 - time) * 0.8
    force = 0.26 * depth + 0.02 * depth**2
    rows = "\n".join(f"{t:.3f},{d:.4f},{f:.4f}" for t, d, f in zip(time, depth, force, strict=True))
    path.write_text(f"time_s,displacement_mm,force_N\n{rows}\n")
    frames = np.arange(0, 39, 0.5)
    for late in (0.2, 2.0):
        values = fat(np.interp(frames - late, time, depth))
        rows = "\n".join(f"{t},{v:.4f}" for t, v in zip(frames, values, strict=True))
        (directory / "us.csv").write_text(f"time_s,fat_thickness_mm\n{rows}\n")
        if late < 1:
            load_subject(directory)
        else:
            refused(directory, "+2.0 s late", "clocks")


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("[channels.fat_thickness]\nlag_s = 1.0", ("lag_s", "one clock")),
        ("[channels.fat_thickness]\nsd_N = 0.1", ("sd_N", "sd_mm")),
        ("[channels.fat_depth]\nsd_mm = 0.1", ("fat_depth", "fat_thickness")),
        ("[channels.fat_thickness]\nsd = 0.1", ("sd",)),
        ("[channels.fat_thickness]\nfile = '../us.csv'", ("leaves the folder",)),
        ("[channels.lateral_force]\nsd_N = 0.1", ("no recording has a column lateral_force_N",)),
    ],
)
def test_what_is_stated_wrongly_is_refused(tmp_path, entry, words):
    columns = {"fat_thickness_mm": fat(depth_of_frames())}
    refused(subject(tmp_path / "leg", columns, f"{AIMED}\n{entry}\n"), *words)


def test_look_proposes_channels_of_either_kind_of_file(tmp_path):
    """Of legfem's own table with empty cells, and of an instrument's with a channel in every row."""
    values = fat(depth_of_frames())
    (own,) = (subject(tmp_path / "leg", {"fat_thickness_mm": values}) / "recordings").glob("*.csv")
    recording = press()
    rows = "\n".join(
        f"{t:.2f};{d:.4f};{f:.4f};{0.05 * f:.4f}"
        for t, d, f in zip(recording.time, recording.displacement, recording.force, strict=True)
    )
    (tmp_path / "rig.csv").write_text(f"Time (s);Displacement (mm);Force (N);Lateral force (N)\n{rows}\n")
    for file, name, words in (
        (own, "fat_thickness", "9 readings, "),
        (tmp_path / "rig.csv", "lateral_force", f"{len(recording)} readings, "),
    ):
        out = tmp_path / name
        assert CliRunner().invoke(app, ["look", str(file), "--out", str(out)]).exit_code == 0
        assert words in (out / "report.txt").read_text()
        stated = tomllib.loads((out / "recordings.toml").read_text())
        assert stated["channels"][name]["lag_s"] == CHANNELS[name].usual.lag
        assert ("recordings" in stated) == (name == "lateral_force")


def test_look_says_how_the_other_axes_of_a_load_cell_are_read(tmp_path):
    at = np.linspace(0.0, 16.0, 300)
    rows = "\n".join(f"{d / 0.4:.3f},{d:.3f},{0.01 * d:.4f},{0.1 * d:.4f},{0.3 * d + 0.01 * d * d:.4f}" for d in at)
    (tmp_path / "six.csv").write_text(f"Time (s),Disp (mm),Fx (N),Fy (N),Fz (N)\n{rows}\n")
    done = CliRunner().invoke(app, ["look", str(tmp_path / "six.csv"), "--force", "Fz", "--out", str(tmp_path / "out")])
    said = " ".join(done.output.split())
    assert "not read: 'Fx', 'Fy'." in said and "called lateral_force and axial_force" in said
    (tmp_path / "six.csv").write_text(f"Time (s),Disp (mm),Lateral force (N),Axial force (N),Fz (N)\n{rows}\n")
    assert {one.name for one in read_samples(tmp_path / "six.csv").channels} == {"lateral_force", "axial_force"}


def test_a_preview_shows_channels(tmp_path):
    folder = subject(tmp_path / "leg", {"fat_thickness_mm": fat(depth_of_frames())})
    seen = preview_of(folder, tmp_path)
    assert not seen.trouble
    assert "fat thickness" in seen.recordings[0].text


def test_sites_have_files_of_their_own(tmp_path):
    """The name of the site is part of the file's."""
    sites = "".join(f'\n[[site]]\nname = "{name}"\n' for name in ("back", "low"))
    stated = AIMED + '[channels.fat_thickness]\nfile = "{site}-{trial}.csv"\n' + sites
    directory = write_subject(tmp_path / "leg", stated)
    (trial,) = (directory / "recordings").glob("*.csv")
    for number, name in enumerate(("back", "low")):
        (directory / "recordings" / name).mkdir()
        (directory / "recordings" / name / "trial1.csv").write_text(trial.read_text())
        rows = "\n".join(f"{t},{v + number}" for t, v in zip(FRAMES, fat(depth_of_frames()), strict=True))
        (directory / f"{name}-trial1.csv").write_text(f"time_s,fat_thickness_mm\n{rows}\n")
    first, second = (load_subject(directory, site=name).recordings[0].channels[0] for name in ("back", "low"))
    np.testing.assert_allclose(second.values - first.values, 1.0)


def test_what_the_tutorial_shows_is_read(tmp_path):
    page = (Path(__file__).resolve().parents[1] / "docs" / "tutorials" / "further-channels.md").read_text()
    (block,) = (one for one in re.findall(r"```toml\n(.*?)```", page, re.DOTALL) if "[channels.fat_thickness]" in one)
    directory = subject(tmp_path / "leg", {"lateral_force_N": 0.01 * depth_of_frames()}, f"{AIMED}\n{block}")
    rows = "\n".join(f"{t},{v}" for t, v in zip(FRAMES, fat(depth_of_frames()), strict=True))
    (directory / "us-trial1.csv").write_text(f"time_s,fat_thickness_mm\n{rows}\n")
    lateral, fat_read = load_subject(directory).recordings[0].channels
    assert (lateral.name, fat_read.name) == ("lateral_force", "fat_thickness")
    assert (fat_read.accuracy.gain, lateral.accuracy.reading) == (0.02, 0.02)

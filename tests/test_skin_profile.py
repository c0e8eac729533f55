"""Points of the skin beside the cylinder, as a leg's folder gives them, become the skin's rises."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely
from making import TOML, press, write_subject

from legfem.channels.kinds import CHANNELS
from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.legs.loading import load_subject
from legfem.legs.subject import Subject

ENTRY = '[channels.skin_profile]\nfile = "skin-{trial}.csv"\nsd_mm = 0.15\n'
TIMES = np.arange(0.0, 50.0, 5.0)


def moved(points: FloatArray, leg: Subject, time: float) -> FloatArray:
    """Move points of the skin against the travel, by more to its left and nearer to the cylinder."""
    aim, travel = leg.indenter.aim, leg.indenter.direction
    left = (points - aim) @ np.array([-travel[1], travel[0]])
    return np.asarray(points - (time / 50.0 * rise(left))[:, None] * travel)


def rise(left: FloatArray) -> FloatArray:
    return np.asarray(3.0 * np.exp(-np.abs(left) / 30.0) * (1 + 0.3 * np.sign(left)))


def folder(
    place: Path,
    times: FloatArray = TIMES,
    turned: float = 0.0,
    shift: float = 0.0,
    noise: float = 0.0,
    every: float = 1.5,
) -> Path:
    """A leg's folder with frames of its whole skin, in a system that is turned (deg) and shifted (mm)."""
    leg = load_subject(write_subject(place))
    skin = leg.section.polygon("skin").exterior
    rng = np.random.default_rng(0)
    rows = ["time_s,x_mm,y_mm"]
    c, s = np.cos(np.deg2rad(turned)), np.sin(np.deg2rad(turned))
    for time in times:
        # Untracked: other points in every frame.
        at = np.arange(rng.uniform(0, every), skin.length, every)
        points = shapely.get_coordinates(shapely.line_interpolate_point(skin, at))
        points = moved(points, leg, time) @ np.array([[c, s], [-s, c]]) + shift
        rows += [f"{time:g},{x:.4f},{y:.4f}" for x, y in points + noise * rng.normal(size=points.shape)]
    (place / "skin-trial1.csv").write_text("\n".join(rows) + "\n")
    (place / "subject.toml").write_text(TOML + ENTRY)
    return place


def off(place: Path) -> float:
    """Greatest difference of the rises that are read from those that were made, mm."""
    (recording,) = load_subject(place).recordings
    assert [one.name for one in recording.channels] == [
        f"skin_rise_{side}_{beside}" for side in ("left", "right") for beside in (25, 40)
    ]
    far = []
    for one in recording.channels:
        side, beside = one.name.split("_")[2:]
        true = rise(np.array(float(beside) * (1 if side == "left" else -1)))
        np.testing.assert_array_equal(one.time, TIMES[1:])
        assert one.accuracy.reading == 0.15
        far.append(float(np.abs(one.values - true * one.time / 50.0).max()))
    return max(far)


def test_rises_are_read_from_untracked_points(tmp_path):
    assert off(folder(tmp_path / "leg")) < 0.02


def test_registration_and_noise_move_them_by_less_than_cameras_err(tmp_path):
    """A system that is 3 degrees and 2 mm off, with 0.1 mm of noise: within twice what cameras usually err by."""
    usual = CHANNELS["skin_rise_left_25"].usual
    assert off(folder(tmp_path / "leg", turned=3.0, shift=2.0, noise=0.1)) < 2 * np.hypot(usual.reading, usual.bias)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"times": TIMES[4:]}, "before the cylinder presses"),
        ({"times": TIMES[:1]}, "two times at least"),
        ({"every": 60.0}, "a few mm apart"),
        ({"shift": 500.0}, "in the outlines' coordinates"),
    ],
)
def test_frames_that_say_nothing_are_refused(tmp_path, change, words):
    with pytest.raises(InputError, match=words):
        load_subject(folder(tmp_path / "leg", **change))


def test_points_are_no_column_of_a_recording(tmp_path):
    place = folder(tmp_path / "leg")
    (place / "subject.toml").write_text(TOML + "[channels.skin_profile]\nsd_mm = 0.2\n")
    with pytest.raises(InputError, match="a file of their own"):
        load_subject(place)
    assert press().force.max() > 0

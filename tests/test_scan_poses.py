"""Where the indenter stands in a scan: poses, landmarks, and planes that cut no leg."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from making import turned_and_moved
from making_scans import PLACE, ellipse, entry_of, made_leg, subject_of_scan

from legfem.common.errors import InputError
from legfem.legs.loading import load_subject
from legfem.legs.plausibility import doubts_about


def test_a_pose_in_the_scan_makes_plane_aim_and_direction(tmp_path, leg_files):
    entry = entry_of(leg_files, "stl")
    place = "aim_mm = [3.0, 70.0]\ndirection_deg = 250.0"
    at_level = subject_of_scan(tmp_path / "level", f"{entry}\nlevel_mm = 50.0", place)
    angle = np.radians(250.0)
    way = np.array([np.cos(angle), np.sin(angle), 0.0])
    posed = subject_of_scan(tmp_path / "posed", entry, _pose(np.array([3.0, 70.0, 50.0]), way))
    assert posed.indenter.direction_deg == pytest.approx(250.0)
    assert posed.indenter.aim == pytest.approx([3.0, 70.0])
    assert posed.section.skin == pytest.approx(at_level.section.skin)
    # Pressed downwards by 12 degrees, the plane tilts with the travel.
    down = np.array([0.0, -np.cos(np.radians(12)), -np.sin(np.radians(12))])
    tilted = subject_of_scan(tmp_path / "tilted", entry, _pose(np.array([3.0, 70.0, 65.0]), down))
    assert tilted.indenter.direction == pytest.approx([0, -1])
    height = np.ptp(tilted.section.skin[:, 1]) / np.ptp(at_level.section.skin[:, 1])
    assert height == pytest.approx(1 / np.cos(np.radians(12)), rel=0.02)


def _pose(position: np.ndarray, way: np.ndarray, more: str = "") -> str:
    return f"position_mm = {position.tolist()}\ndirection = {way.tolist()}\n{more}"


def _landmarks(folder: Path, scan: np.ndarray, tracker: np.ndarray) -> str:
    rows = ["name,x_mm,y_mm,z_mm,scan_x_mm,scan_y_mm,scan_z_mm"]
    rows += [
        f"point {k},{a[0]:.4f},{a[1]:.4f},{a[2]:.4f},{b[0]:.4f},{b[1]:.4f},{b[2]:.4f}"
        for k, (a, b) in enumerate(zip(tracker, scan, strict=True))
    ]
    (folder / "landmarks.csv").write_text("\n".join(rows) + "\n")
    return f'landmarks = "{folder}/landmarks.csv"'


SCAN_POINTS = np.array([[-10.0, -60, 5], [30, -50, 90], [60, 10, 20], [-58, 5, 70.0]])


TRACKER = turned_and_moved((40.0, -25.0, 130.0), np.array([500.0, -200.0, 90.0]))


def test_landmarks_bring_a_pose_from_the_tracker_into_the_scan(tmp_path, leg_files):
    entry, way = entry_of(leg_files, "csv"), np.array([0.1, -1.0, 0.05])
    position = np.array([3.0, 70.0, 50.0])
    there = subject_of_scan(tmp_path / "scan", entry, _pose(position, way))
    more = _landmarks(tmp_path, SCAN_POINTS, TRACKER(SCAN_POINTS))
    pose = _pose(TRACKER(position), TRACKER.rotation @ way, more)
    tracked = subject_of_scan(tmp_path / "tracker", entry, pose)
    assert tracked.indenter.aim == pytest.approx(there.indenter.aim, abs=1e-3)
    assert tracked.indenter.direction_deg == pytest.approx(there.indenter.direction_deg, abs=1e-3)
    assert tracked.section.skin == pytest.approx(there.section.skin, abs=0.01)
    assert tracked.landmark_residual == pytest.approx(0.0, abs=1e-3)
    _landmarks(tmp_path, SCAN_POINTS, TRACKER(SCAN_POINTS) + 4 * np.eye(4, 3))
    off = load_subject(tmp_path / "tracker", need_recordings=False)
    assert [doubt.field for doubt in doubts_about(off)] == ["indenter.landmarks"]
    _landmarks(tmp_path, SCAN_POINTS, TRACKER(SCAN_POINTS[[1, 0, 2, 3]]))
    with pytest.raises(InputError, match=r"point \d: lies .* mm off once registered"):
        load_subject(tmp_path / "tracker", need_recordings=False)


@pytest.mark.parametrize(
    ("section", "place", "words"),
    [
        ("level_mm = 500.0", PLACE, "leaves the scan|levels between"),
        ("", PLACE, "section.level_mm: missing"),
        (
            "level_mm = 50.0",
            "position_mm = [0.0, 70.0, 50.0]\ndirection = [0.0, -1.0, 0.0]",
            "beside indenter.position_mm",
        ),
        ("", "position_mm = [0.0, 70.0, 50.0]\ndirection_deg = 270.0", "belong together"),
        ("", "position_mm = [0.0, 70.0, 50.0]\ndirection = [0.0, 0.1, 1.0]", "doesn't lie across the leg"),
        (
            "",
            "position_mm = [0.0, 70.0, 50.0]\ndirection = [0.0, -1.0, 0.0]\naxis = [0.0, -1.0, 1.0]",
            "axis: stands at 45 degrees",
        ),
        (
            "",
            "position_mm = [0.0, 70.0, 90.0]\ndirection = [0.0, -1.0, 0.3]",
            "ends within the section|leaves the scan",
        ),
        ("level_mm = 50.0", f"{PLACE}\naxis = [0.0, 0.0, 1.0]", "of use with position_mm alone"),
        ("level_mm = 50.0\nseries = 'dicom'", PLACE, "series: is given without a scan"),
    ],
)
@pytest.mark.parametrize("kind", ["stl", "csv"])
def test_planes_that_cut_no_leg_give_one_line(tmp_path, leg_files, kind, section, place, words):
    if kind == "csv" and not section and "aim_mm" in place:
        words = "level_mm: these are contours at several levels"
    with pytest.raises(InputError, match=words) as caught:
        subject_of_scan(tmp_path / "leg", f"{entry_of(leg_files, kind)}\n{section}", place)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("angle", [0.0, 45.0, 90.0, 200.0])
def test_the_aim_follows_the_direction(tmp_path, leg_files, angle):
    sections = str(leg_files / "sections.csv")
    options = ["--cross-sections", sections, "--level", "50", "--direction", str(angle)]
    leg = made_leg(tmp_path / "leg", *options)
    x, y, a, b = ellipse("skin", 50.0)
    way = -leg.indenter.direction
    # The ellipse's point with this normal.
    facing = np.array([x, y]) + np.array([a**2, b**2]) * way / np.hypot(a * way[0], b * way[1])
    across = np.array([-way[1], way[0]])
    assert (leg.indenter.aim - facing) @ across == pytest.approx(0.0, abs=1.0)
    assert (leg.indenter.aim - facing) @ way == pytest.approx(0.0, abs=0.1)

"""Contours: reading, checks, measures and smooth curves."""

from __future__ import annotations

import numpy as np
import pytest
from making import circle, leg, write_contours

from legfem.common.errors import InputError
from legfem.geometry.contours import read_contours
from legfem.geometry.section import (
    LegSection,
    fat_thickness,
    girth,
    minimal_fat_thickness,
    resample_closed_curve,
    smooth_closed_curve,
)


def _refused(path, thickness=0.6):
    with pytest.raises(InputError) as caught:
        read_contours(path, thickness)
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith(str(path))
    assert caught.value.remedy
    return caught.value


def test_measures_of_a_round_leg(tmp_path):
    section = read_contours(write_contours(tmp_path / "c.csv", leg()), 0.6)
    assert girth(section) == pytest.approx(2 * np.pi * 60, rel=1e-3)
    assert minimal_fat_thickness(section) == pytest.approx(6, abs=0.02)
    at, up = np.array([0.0, 0.0]), np.array([0.0, 2.0])
    assert fat_thickness(section, at, up) == pytest.approx(6, abs=0.02)
    assert fat_thickness(section, np.array([5.0, 80.0])) == pytest.approx(6, abs=0.02)
    off_centre = np.sqrt(60**2 - 20**2) - np.sqrt(54**2 - 20**2)
    assert fat_thickness(section, np.array([20.0, 0.0]), up) == pytest.approx(off_centre, abs=0.02)


def test_direction_and_repeated_end_do_not_matter(tmp_path):
    parts = leg()
    plain = read_contours(write_contours(tmp_path / "a.csv", parts), 0.6)
    parts["skin"] = parts["skin"][::-1]
    parts["tibia"] = np.vstack([parts["tibia"], parts["tibia"][:1]])
    other = read_contours(write_contours(tmp_path / "b.csv", parts), 0.6)
    assert other.polygon("skin").equals(plain.polygon("skin"))
    assert other.polygon("skin").exterior.is_ccw
    assert other.bones["tibia"].shape == plain.bones["tibia"].shape


@pytest.mark.parametrize(
    ("part", "change", "field", "words"),
    [
        ("fascia", lambda p: p[:0], "fascia", "missing"),
        ("tibia", lambda p: p[::8], "tibia", "too few"),
        ("skin", lambda p: p[:-20], "skin", "open"),
        ("skin", lambda p: p[np.r_[0:50, 60, 55, 50, 65:200]], "skin", "crosses itself"),
        ("fascia", lambda p: p * [1.2, 0.9], "fascia", "crosses or touches the skin"),
        ("fascia", lambda p: p * 1.2, "fascia", "outside the skin"),
        ("tibia", lambda p: p + np.array([0, 90]), "tibia", "outside the skin"),
        ("tibia", lambda p: p + np.array([0, 11]), "tibia", "crosses or touches the fascia"),
        ("tibia", lambda p: p + np.array([-40, 0]), "tibia", "crosses or touches the skin"),
        ("fibula", lambda p: p - [20, 0], "fibula", "crosses the tibia"),
        ("fascia", lambda p: p * 59.7 / 54, "fascia_thickness_mm", "thicker than the fat"),
        ("tibia", lambda p: p - p.mean(axis=0) + [0, 40.7], "fascia_thickness_mm", "meets the tibia"),
    ],
)
def test_impossible_contours_are_explained(tmp_path, part, change, field, words):
    parts = leg()
    parts[part] = change(parts[part])
    error = _refused(write_contours(tmp_path / "contours.csv", parts))
    assert error.field == field
    assert words in str(error)


@pytest.mark.parametrize(("factor", "unit"), [(0.1, "centimetres"), (0.001, "metres")])
def test_other_units_are_recognised(tmp_path, factor, unit):
    parts = {part: xy * factor for part, xy in leg().items()}
    error = _refused(write_contours(tmp_path / "contours.csv", parts), thickness=0.6 * factor)
    assert f"look like {unit}" in error.problem
    assert error.remedy == f"multiply the coordinates by {1 / factor:g}"


@pytest.mark.parametrize(
    ("old", "new", "field", "words"),
    [
        ("part,x_mm,y_mm", "part,x_cm,y_cm", "header", "'x_cm' where 'x_mm'"),
        ("part,x_mm,y_mm", "part;x_mm;y_mm", "header", "commas"),
        ("part,x_mm,y_mm", "x_mm,y_mm,part", "header", "order"),
        ("part,x_mm,y_mm", "part,x_mm", "header", "'y_mm' is missing"),
        ("skin,60.0000,0.0000", "skin,60,0000,0,0000", "line 2", "decimal"),
        ("skin,60.0000,0.0000", 'skin,"60,0",0.0000', "x_mm, line 2", "decimal comma"),
        ("skin,60.0000,0.0000", "skin,nan,0.0000", "x_mm, line 2", "not a finite number"),
        ("skin,60.0000,0.0000", "skin,60.0000,", "y_mm, line 2", "not a finite number"),
        ("skin,60.0000,0.0000", "skin,60.0000,abc", "y_mm, line 2", "not a number"),
        ("skin,60.0000,0.0000", "skni,60.0000,0.0000", "part, line 2", "mean 'skin'"),
    ],
)
def test_unreadable_tables_are_explained(tmp_path, old, new, field, words):
    path = write_contours(tmp_path / "contours.csv", leg())
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    error = _refused(path)
    assert error.field == field
    assert words in str(error)


def test_an_absent_or_empty_file_is_named(tmp_path):
    assert "not found" in _refused(tmp_path / "none.csv").problem
    (tmp_path / "empty.csv").write_text("")
    assert _refused(tmp_path / "empty.csv").field == "header"


def test_a_smooth_curve_follows_uneven_points_and_closes():
    rng = np.random.default_rng(1)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 150))
    points = np.column_stack([60 * np.cos(angle), 60 * np.sin(angle)])
    curve = smooth_closed_curve(np.vstack([points, points[:1], points[:1]]))
    s = np.linspace(0, 1, 500)
    assert np.abs(np.linalg.norm(curve(s), axis=1) - 60).max() < 0.02
    assert curve(0.0) == pytest.approx(curve(1.0))
    assert curve.tangent(1 - 1e-9) == pytest.approx(curve.tangent(0.0), abs=1e-6)
    assert curve.length == pytest.approx(2 * np.pi * 60, rel=1e-3)


def test_resampling_is_even_and_smoothing_takes_noise_away():
    rng = np.random.default_rng(2)
    noisy = circle(3, -4, 50, 300) + 0.1 * rng.standard_normal((300, 2))
    smooth = resample_closed_curve(noisy, 1.5, smoothing=0.1)
    radii = np.linalg.norm(smooth - [3, -4], axis=1)
    assert np.abs(radii - 50).max() < 0.12
    spacing = np.linalg.norm(np.diff(smooth, axis=0), axis=1)
    assert spacing == pytest.approx(1.5, rel=0.01)
    with pytest.raises(ValueError, match="positive"):
        resample_closed_curve(noisy, 0.0)


def test_a_section_copies_what_it_is_given():
    parts = leg()
    section = LegSection.of_parts(parts, 0.6)
    parts["skin"][:] = 0.0
    assert girth(section) > 370


def test_points_that_fall_together_are_no_contour(tmp_path):
    """What a fuzz found: a column of zeros leaves a contour without points."""
    parts = leg()
    parts["tibia"] = np.full_like(parts["tibia"], 3.0)
    with pytest.raises(InputError, match="tibia: only 0 of its points lie apart"):
        read_contours(write_contours(tmp_path / "contours.csv", parts), 0.6)

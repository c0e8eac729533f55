"""The shape of a leg: levels, correspondence, motion, measures, smoothing, files."""

from __future__ import annotations

import re

import numpy as np
import pytest
from making import circle
from making_legs_3d import round_leg
from making_stocking import write_shape
from scipy.spatial.transform import Rotation

from legfem.common.errors import InputError
from legfem.geometry.leg_shape import (
    LegShape,
    PartSurface,
    check_shape,
    corresponding,
    fat_thickness_around,
    largest_girth,
    perimeter,
    shape_of_contours,
)
from legfem.geometry.motion import displaced, rigidly_moved, without_layer
from legfem.imaging.outlines import read_shape, smoothed
from studies.making.shapes import horizontal_curvature


def cone(slope: float = 0.1) -> LegShape:
    """Radius 50 mm at z = 0, growing by ``slope``; off the axis; two bones."""
    levels = np.arange(0.0, 61.0, 5.0)
    parts = {
        "skin": [circle(3, 2, 50 + slope * z, 400) for z in levels],
        "hull": [circle(4, 2, 42 + slope * z, 300) for z in levels],
        "tibia": [circle(-10, 15, 12, 100) for _ in levels],
        "fibula": [circle(15, 10 + 0.05 * z, 6, 100) for z in levels],
    }
    return shape_of_contours(levels, parts, 120)


def test_points_correspond_whatever_the_order_and_start_of_the_contour():
    turn = 2 * np.pi * np.arange(200) / 200
    loop = np.column_stack([60 * np.cos(turn) + 5, 40 * np.sin(turn) + 1])
    wanted = corresponding(loop, 90)
    uneven = np.sort(np.random.default_rng(1).uniform(0, 2 * np.pi, 500))
    other = np.column_stack([60 * np.cos(uneven) + 5, 40 * np.sin(uneven) + 1])
    for same in (np.roll(loop, 77, axis=0), loop[::-1], np.roll(loop[::-1], 31, axis=0), other):
        assert np.abs(corresponding(same, 90) - wanted).max() < 2e-3
    assert wanted[0] == pytest.approx([65, 1], abs=1e-3)
    spacing = np.linalg.norm(wanted - np.roll(wanted, 1, axis=0), axis=1)
    assert np.ptp(spacing) < 2e-3 * spacing.mean()


def test_levels_between_are_interpolated():
    shape = cone()
    skin = shape.at("skin", 32.3) - [3, 2]
    assert np.linalg.norm(skin, axis=1) == pytest.approx(53.23, abs=1e-4)
    assert shape.at("skin", [3.0, 4.0]).shape == (2, 120, 2)
    growth = (shape.at("skin", 32.3, slope=1) * skin).sum(axis=1) / 53.23
    assert growth == pytest.approx(0.1, abs=1e-4)
    finer = shape.at_levels(np.arange(1.0, 59.0))
    assert finer.contours["fibula"].shape == (58, 120, 2)
    with pytest.raises(InputError, match="not within the segment"):
        shape.at("skin", 61)


def test_perimeter_curvature_and_fat_of_circles():
    shape = cone()
    radius = 50 + 0.1 * shape.levels
    assert perimeter(shape) == pytest.approx(2 * np.pi * radius, rel=2e-4)
    assert horizontal_curvature(shape) == pytest.approx(np.broadcast_to(1 / radius[:, None], (13, 120)), rel=1e-4)
    assert horizontal_curvature(shape, "fibula") == pytest.approx(1 / 6, rel=1e-3)
    fat = fat_thickness_around(shape)
    assert fat.min() == pytest.approx(7, abs=0.02)
    assert fat.max() == pytest.approx(9, abs=0.02)
    assert largest_girth(shape) == 60


def test_a_concave_stretch_has_negative_curvature():
    turn = 2 * np.pi * np.arange(720) / 720
    radius = 50 - 6 * np.exp(-(((turn - np.pi) / 0.3) ** 2))
    dented = np.column_stack([radius * np.cos(turn), radius * np.sin(turn)])
    levels = [0.0, 1.0]
    parts = {"skin": [dented] * 2, "hull": [circle(0, 0, 30, 90)] * 2, "b": [circle(0, 0, 9)] * 2}
    curvature = horizontal_curvature(shape_of_contours(levels, parts, 360))
    # 1/r + r''/r^2 changes sign at the dent's bottom.
    bottom = 1 / 44 - (2 * 6 / 0.3**2) / 44**2
    assert curvature.min() == pytest.approx(bottom, rel=0.02)
    assert bottom < 0


def test_a_rigid_motion_is_undone_by_its_inverse():
    shape = cone()
    turn = Rotation.from_euler("xyz", [4, -3, 20], degrees=True).as_matrix()
    shift = np.array([5.0, -8.0, 12.0])
    there = rigidly_moved(shape, turn, shift)
    assert there.levels[0] > 10
    back = rigidly_moved(there, turn.T, -turn.T @ shift).at_levels(np.linspace(20, 40, 21))
    for part in shape.parts:
        centre = {"skin": [3, 2], "hull": [4, 2], "tibia": [-10, 15]}.get(part)
        if centre is None:
            continue
        wanted = {"skin": 50 + 0.1 * back.levels, "hull": 42 + 0.1 * back.levels, "tibia": 12.0}
        radius = np.linalg.norm(back.contours[part] - centre, axis=2)
        assert radius == pytest.approx(np.broadcast_to(np.atleast_1d(wanted[part])[:, None], radius.shape), abs=2e-3)


def test_a_deformed_shape_is_cut_at_its_new_levels():
    shape = cone(slope=0.0)
    points = shape.points("skin")
    move = np.zeros_like(points)
    move[..., 2] = 0.2 * points[..., 2]
    move[..., :2] = 0.01 * points[..., 2:3] * np.array([1.0, 0.0])
    others = {
        p: np.concatenate([np.zeros_like(shape.contours[p]), 0.2 * shape.points(p)[..., 2:]], axis=2)
        for p in shape.parts
        if p != "skin"
    }
    now = displaced(shape, {"skin": move, **others}).at_levels([30.0, 36.0])
    centre = now.at("skin", 36.0).mean(axis=0)
    assert centre == pytest.approx([3 + 0.01 * 30, 2], abs=1e-3)
    with pytest.raises(InputError, match="fold back"):
        upside_down = np.concatenate([np.zeros((13, 120, 2)), 60 - 2 * points[..., 2:]], axis=2)
        displaced(shape, dict.fromkeys(shape.parts, upside_down))


def test_smoothing_removes_short_waves_and_keeps_long_ones():
    levels = np.arange(0.0, 101.0)
    turn = 2 * np.pi * np.arange(720) / 720

    def skin(z: float) -> np.ndarray:
        # Waves of 7 mm around and of 5 mm along, on an ellipse that grows steadily.
        radius = 1 + 0.01 * np.sin(50 * turn) + 0.01 * np.sin(2 * np.pi * z / 5) + 0.001 * z
        return np.column_stack([58 * radius * np.cos(turn), 52 * radius * np.sin(turn)])

    parts = {
        "skin": [skin(z) for z in levels],
        "hull": [circle(0, 0, 40, 200)] * 101,
        "bone": [circle(5, 5, 10, 100)] * 101,
    }
    smooth = smoothed(shape_of_contours(levels, parts, 360), around=30.0, along=20.0)
    scale = np.hypot(smooth.contours["skin"][..., 0] / 58, smooth.contours["skin"][..., 1] / 52)
    wanted = np.broadcast_to((1 + 0.001 * levels)[:, None], scale.shape)
    assert np.abs(scale - wanted)[10:-10].max() < 4e-4
    # A wave that ends there can't be told from a slope.
    assert np.abs(scale - wanted).max() < 3e-3
    assert np.linalg.norm(smooth.at("bone", 50.0) - 5, axis=1) == pytest.approx(10, abs=1e-3)
    assert smooth.at("hull", 50.0) == pytest.approx(circle(0, 0, 40, 360), abs=0.01)


def test_a_file_gives_the_shape_back(tmp_path):
    shape = cone()
    write_shape(shape, tmp_path / "leg.csv")
    again = read_shape(tmp_path / "leg.csv")
    assert again.bones == ("tibia", "fibula")
    assert again.levels == pytest.approx(shape.levels)
    for part in shape.parts:
        assert again.contours[part] == pytest.approx(shape.contours[part], abs=2e-4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.replace(",hull,", ",hulk,"), "hull: the part is missing"),
        (lambda t: t.replace("5.0000,tibia", "6.0000,tibia"), "0 points are too few"),
        (lambda t: t.replace("x_mm", "x_cm"), "found column 'x_cm'"),
        (lambda t: re.sub(r"(\d+\.\d{4}),(skin|hull|tibia|fibula)", r"1e4\1,\2", t), "level_mm"),
        (lambda t: re.sub(r",[-\d.]+$", ",1.0", t, flags=re.MULTILINE), "x_mm, y_mm"),
    ],
)
def test_a_bad_file_gives_one_line(tmp_path, change, message):
    path = tmp_path / "leg.csv"
    write_shape(cone(), path)
    path.write_text(change(path.read_text()))
    with pytest.raises(InputError, match=message) as caught:
        read_shape(path)
    assert "\n" not in str(caught.value)


def test_parts_have_to_nest_and_be_of_a_leg():
    check_shape(cone(), "made", clearance=2.0)
    shape = cone()
    outside = {**shape.contours, "tibia": shape.contours["tibia"] + [-40, 0]}
    with pytest.raises(InputError, match="tibia, level 0 mm: crosses or touches the skin"):
        check_shape(LegShape(shape.levels, outside), "made")
    with pytest.raises(InputError, match=r"mm left to the skin where 8\.00 are needed"):
        check_shape(shape, "made", clearance=8.0)
    together = {**shape.contours, "fibula": shape.contours["tibia"] + [1, 0]}
    with pytest.raises(InputError, match="fibula, level 0 mm: touches or crosses the tibia"):
        check_shape(LegShape(shape.levels, together), "made")
    small = LegShape(shape.levels, {p: xy / 10 for p, xy in shape.contours.items()})
    with pytest.raises(InputError, match="look like centimetres"):
        check_shape(small, "made")
    with pytest.raises(InputError, match="skin: the part is missing"):
        LegShape(shape.levels, {p: xy for p, xy in shape.contours.items() if p != "skin"})


def test_a_round_leg_is_round():
    leg = round_leg(radius=50, hull_radius=44, core_radius=12, length=40)
    assert leg.bones == ("core",)
    for part, radius in (("skin", 50), ("hull", 44), ("core", 12)):
        assert np.linalg.norm(leg.contours[part], axis=2) == pytest.approx(radius, abs=1e-5)


def test_smoothing_may_leave_parts_as_they_are():
    shape = cone()
    smooth = smoothed(shape, around=60.0, parts=("tibia",))
    assert np.array_equal(smooth.contours["skin"], shape.contours["skin"])
    assert not np.array_equal(smooth.contours["tibia"], shape.contours["tibia"])


def test_points_near_a_surface_are_put_onto_it():
    rng = np.random.default_rng(1)
    angle, z = rng.uniform(0, 2 * np.pi, 200), rng.uniform(0, 60, 200)
    away = np.column_stack([np.cos(angle), np.sin(angle)])
    radius = 50 + 0.1 * z
    near = np.column_stack([(3, 2) + (radius - rng.uniform(0, 0.6, 200))[:, None] * away, z])
    found = PartSurface(cone(), "skin").nearest_at_level(near)
    # The contour itself is a spline through points 0.8 mm apart.
    assert found == pytest.approx(np.column_stack([(3, 2) + radius[:, None] * away, z]), abs=2e-4)


def test_a_layer_taken_out_leaves_fat_and_bones_as_thick_as_they_were():
    leg = cone()
    thin = without_layer(leg, 0.6)
    for part, radius in (("skin", 50.0), ("hull", 42.0)):
        across = thin.contours[part] - leg.contours[part].mean(axis=1, keepdims=True)
        wanted = radius + 0.1 * leg.levels[:, None] - 0.6
        np.testing.assert_allclose(np.linalg.norm(across, axis=-1), wanted + 0 * across[..., 0], rtol=1e-4)
    np.testing.assert_array_equal(thin.contours["tibia"], leg.contours["tibia"])
    np.testing.assert_allclose(fat_thickness_around(thin), fat_thickness_around(leg), atol=0.01)

"""Indenters in any pose: where they first touch a leg, and their signed distances."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import ufl
from making import write_subject
from making_sites import SITE_TABLES, write_sites
from typer.testing import CliRunner

from legfem.commands.diagnose import app as diagnose_app
from legfem.commands.identify import app as identify_app
from legfem.common.errors import InputError
from legfem.experiments.indenter_pose import Ball, Cylinder, LegIndenter, Pose, Punch
from legfem.experiments.leg_3d import LegIndentation3D
from legfem.geometry.indenter import Indenter
from legfem.geometry.leg_shape import LegShape
from legfem.geometry.motion import turn_about_travel
from legfem.legs.finite_element_models import plane_strain_test, spatial_test
from legfem.legs.forward import PlaneStrainForward
from legfem.legs.loading import load_sites, load_subject
from legfem.legs.placement import spatial_leg
from legfem.mechanics.indenters import FiniteCylinder
from legfem.mechanics.materials import NeoHookean

TISSUES = {"deep": NeoHookean(1e-3, 28.0), "superficial": NeoHookean(2e-3, 22.5)}
RADIUS, LENGTH = 40.0, 120.0
CYLINDER = Cylinder(radius=15.0, length=30.0, edge_radius=2.0)


def cone(slope: float = 0.0) -> LegShape:
    angle = np.linspace(0, 2 * np.pi, 96, endpoint=False)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    levels = np.linspace(-LENGTH / 2, LENGTH / 2, 9)
    skin = np.array([(RADIUS + slope * z) * ring for z in levels])
    return LegShape(levels, {"skin": skin, "hull": 0.8 * skin, "tibia": 0.3 * skin})


def pressed(given: LegIndenter, axis_deg: float = 0.0, slope: float = 0.0) -> LegIndentation3D:
    return LegIndentation3D(cone(slope), given, Pose((0.0, 0.0), 0.0, 200.0, axis_deg), TISSUES)


@pytest.mark.parametrize(
    ("given", "axis_deg", "ahead"),
    [
        (CYLINDER, 0.0, 15.0),
        (CYLINDER, 90.0, 15.0),
        (CYLINDER, 35.0, 15.0),
        (Ball(12.0), 0.0, 12.0),
        (Punch(10.0, 24.0, 2.0), 0.0, 12.0),
    ],
)
def test_whatever_presses_a_round_leg_first_touches_it_with_its_front(given, axis_deg, ahead):
    test = pressed(given, axis_deg)
    expected = -(RADIUS + ahead) * test.pose.direction
    np.testing.assert_allclose(test.touch, expected, atol=1e-4)


def test_on_a_cone_an_end_s_rounding_touches_first_and_across_it_the_flank():
    slope = 0.2
    tilt = np.arctan(slope)
    # The centre of the rounding is its radius from the cone's side; of a long cylinder across it,
    # where the side is square to the travel, the axis lies its radius from it.
    corner = 15.0 - 2.0 + 2.0 / np.cos(tilt) + slope * (15.0 - 2.0)
    along = RADIUS + corner
    across = RADIUS + 15.0 / np.cos(tilt)
    for axis_deg, expected in ((0.0, along), (90.0, across)):
        touch = pressed(CYLINDER, axis_deg, slope).touch
        assert np.linalg.norm(touch) == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize("axis_deg", [0.0, 35.0, 90.0])
def test_a_turned_cylinder_is_the_upright_one_seen_from_its_own_frame(axis_deg):
    pose = Pose((0.0, 0.0), 0.0, 200.0, axis_deg)
    assert np.allclose(pose.frame @ pose.frame.T, np.eye(3))
    assert np.linalg.det(pose.frame) == pytest.approx(1.0)
    turned, upright = CYLINDER.placed(pose), FiniteCylinder(15.0, 15.0, 2.0)
    rng = np.random.default_rng(1)
    for y in rng.uniform(-25, 25, (30, 3)):
        axis, side, travel = pose.frame @ y
        own = ufl.as_vector([float(side), float(travel), float(axis)])
        there = ufl.as_vector([float(v) for v in y])
        assert float(turned.gap(there)) == pytest.approx(float(upright.gap(own)), abs=1e-9)
        a, b = (np.array([float(n[k]) for k in range(3)]) for n in (turned.normal(there), upright.normal(own)))
        np.testing.assert_allclose(pose.frame @ a, [b[2], b[0], b[1]], atol=1e-9)


def test_an_indenter_beyond_the_leg_is_refused_by_what_it_takes_of_the_leg():
    shape = cone()
    for given, axis_deg, reach in ((CYLINDER, 0.0, 15.0), (Cylinder(15.0, 100.0), 90.0, 15.0)):
        level = LENGTH / 2 - reach
        LegIndentation3D(shape, given, Pose((0, 0), level, 0.0, axis_deg), TISSUES)
        with pytest.raises(InputError, match="leaves the leg"):
            LegIndentation3D(shape, given, Pose((0, 0), level + 1, 0.0, axis_deg), TISSUES)


def test_a_line_of_travel_beside_the_leg_is_refused():
    with pytest.raises(InputError, match="misses the leg"):
        _ = LegIndentation3D(cone(), Ball(5.0), Pose((60.0, 0.0), 0.0, 90.0), TISSUES).touch


def test_an_indenter_says_what_it_is_and_what_it_takes_of_the_leg():
    aim = np.zeros(2)
    along, across = (Indenter(15.0, 50.0, aim, 90.0, axis_deg=turn) for turn in (0.0, 90.0))
    ball = Indenter(10.0, 20.0, aim, 90.0, "ball")
    assert (along.extent, ball.extent) == (50.0, 20.0)
    assert across.extent == pytest.approx(30.0)
    assert "across the leg" in str(across) and "across the leg" not in str(along)
    along.check_lies_along("subject.toml")
    for one in (across, ball):
        with pytest.raises(InputError, match="--model 3d"):
            one.check_lies_along("subject.toml")


def folder_with(folder: Path, indenter: str, more: str = "") -> Path:
    """Write a subject's folder of which only the indenter is of another kind."""
    write_subject(folder)
    toml = folder / "subject.toml"
    text = re.sub(r"length_mm = .*\n", indenter + "\n", toml.read_text(), count=1)
    toml.write_text(text + more)
    return folder


@pytest.mark.parametrize(
    ("indenter", "kind", "extent"),
    [
        ("length_mm = 50.0\naxis_deg = 90.0", Cylinder, 30.0),
        ('shape = "ball"', Ball, 30.0),
        ('shape = "punch"', Punch, 30.0),
    ],
)
def test_a_folder_says_what_presses_and_how_it_lies(tmp_path, indenter, kind, extent):
    subject = load_subject(folder_with(tmp_path, indenter), need_recordings=False)
    assert subject.indenter.extent == pytest.approx(extent)
    leg = spatial_leg(subject)
    test = spatial_test(subject, leg)
    assert type(test.indenter) is kind
    assert test.pose.axis_deg == (90.0 if kind is Cylinder else 0.0)
    with pytest.raises(InputError, match="plane strain"):
        PlaneStrainForward.of_subject(subject, 5.0)
    with pytest.raises(InputError, match="plane strain"):
        plane_strain_test(subject)


@pytest.mark.parametrize(
    ("indenter", "match"),
    [
        ("", "length_mm: missing"),
        ('shape = "ball"\naxis_deg = 90.0', "axis_deg: has no effect for a ball"),
        ('shape = "cube"', "indenter.shape"),
    ],
)
def test_an_indenter_that_can_t_be_is_one_line(tmp_path, indenter, match):
    with pytest.raises(InputError, match=match):
        load_subject(folder_with(tmp_path, indenter), need_recordings=False)


def test_a_site_s_cylinder_may_lie_otherwise(tmp_path):
    write_sites(tmp_path, SITE_TABLES + "axis_deg = 90.0\n")
    back, medial = load_sites(tmp_path).sites
    assert back.indenter.lies_along and not medial.indenter.lies_along
    for app, more in ((identify_app, []), (diagnose_app, ["--site", "medial"])):
        ran = CliRunner().invoke(app, ["--subject-dir", str(tmp_path), "--out", str(tmp_path / "out"), *more])
        assert ran.exit_code == 2
        assert "across the leg" in ran.stderr and "--model 3d" in ran.stderr
        assert not (tmp_path / "out").exists()


def test_a_registered_axis_across_the_leg_leaves_the_section_across_it():
    travel, tilt = np.array([0.0, -1.0, 0.0]), np.radians(10.0)
    for axis, turn in (
        ([0.0, 0.0, 1.0], 0.0),
        ([0.0, 0.0, -1.0], 0.0),
        ([np.sin(tilt), 0.0, np.cos(tilt)], -10.0),
        ([1.0, 0.0, 0.0], -90.0),
    ):
        found = turn_about_travel(travel, np.array(axis), "subject.toml")
        assert found == pytest.approx(turn, abs=1e-9)
        pose = Pose((0.0, 0.0), 0.0, 270.0, found)
        assert abs(pose.frame[0] @ axis) == pytest.approx(1.0)
    with pytest.raises(InputError, match="stands at 45 degrees"):
        turn_about_travel(travel, np.array([0.0, -1.0, 1.0]), "subject.toml")

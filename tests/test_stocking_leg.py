"""Folders of legs in stockings: what is read, and what is refused in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from making import turned_and_moved
from making_stocking import LEG_TOML, write_shape
from shapely import Point, Polygon

from legfem.common.errors import InputError
from legfem.geometry.leg_shape import LegShape
from legfem.geometry.motion import rigidly_moved
from legfem.stockings.leg import GAP, default_veins
from legfem.stockings.loading import LEGS, load_leg
from studies.making.shapes import parametric_leg, read_legs
from studies.stockings.command import LEGS as SHAPES


@pytest.fixture(scope="module")
def shape() -> LegShape:
    return parametric_leg(read_legs(SHAPES)["1"], n_points=90)


@pytest.fixture
def folder(tmp_path: Path, shape: LegShape) -> Path:
    write_shape(shape, tmp_path / "bare.csv")
    motion = turned_and_moved((0.3, -0.2, 2.0), np.array([3.0, -2.0, 0.5]))
    moved = rigidly_moved(shape, motion.rotation, motion.translation)
    write_shape(moved, tmp_path / "compressed.csv")
    (tmp_path / "leg.toml").write_text(LEG_TOML)
    return tmp_path


def test_both_scans_come_into_the_same_place(folder, shape):
    leg = load_leg(folder)
    assert leg.compressed is not None and leg.registration is not None
    assert leg.registration.residual < 0.02
    np.testing.assert_allclose(leg.bare.levels, leg.compressed.levels)
    # Without a stocking between them, the two are one leg; along z the bones hold it loosely.
    difference = leg.bare.contours["skin"] - leg.compressed.contours["skin"]
    assert np.abs(difference).max() < 0.15
    assert len(leg.slices) == 5 and np.ptp(leg.slices) == pytest.approx(30.0)
    assert leg.stocking.unstretched.max() < 0.9 * 362


@pytest.mark.parametrize(
    "before, after, words",
    [
        ('contours = "bare.csv"', 'contours = "no.csv"', "no file 'no.csv'"),
        ('contours = "bare.csv"', 'contours = "bare.csv"\nscan = "a.nii"', "2 sources"),
        ('compression_class = "2"', 'compression_class = "7"', "unknown value '7'"),
        ('compression_class = "2"', 'compression_clas = "2"', "did you mean 'compression_class'"),
        ('compression_class = "2"', "unstretched_mm = 2.0", "out of range"),
        ('[compressed]\ncontours = "compressed.csv"', "", "compressed: missing"),
        ("[stocking]", "[segment]\nfrom_mm = 60.0\nto_mm = 80.0\n[stocking]", "20 mm long"),
        ("[stocking]", "[segment]\nfrom_mm = 60.0\nto_mm = 105.0\n[stocking]", "45 mm long; give scans"),
        ("[stocking]", "[segment]\nfrom_mm = -60.0\n[stocking]", "not in what the scans share"),
        ('origin = "simulated"', 'origin = "guessed"', "unknown value 'guessed'"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(folder, before, after, words):
    toml = (folder / "leg.toml").read_text()
    assert before in toml
    (folder / "leg.toml").write_text(toml.replace(before, after))
    with pytest.raises(InputError) as caught:
        load_leg(folder)
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_a_leg_in_metres_is_refused(folder, shape):
    small = LegShape(shape.levels / 1e3, {p: xy / 1e3 for p, xy in shape.contours.items()})
    write_shape(small, folder / "bare.csv")
    with pytest.raises(InputError, match="mm"):
        load_leg(folder)


def test_without_the_second_scan_known_stiffness_serves(folder):
    toml = (folder / "leg.toml").read_text().replace('[compressed]\ncontours = "compressed.csv"', "")
    (folder / "leg.toml").write_text(toml + "[tissues.deep]\nC10_kPa = 3.25\n[tissues.superficial]\nC10_kPa = 8.17\n")
    leg = load_leg(folder)
    assert leg.compressed is None and leg.known
    assert leg.tissues["superficial"].C10 == pytest.approx(8.17e-3)


def test_an_unknown_leg_names_those_there_are():
    with pytest.raises(InputError, match="known subjects are"):
        LEGS.find("nobody")


def test_veins_stand_beside_the_bones_in_the_muscle(shape):
    level = 80.0
    hull = Polygon(shape.at("hull", level))
    bones = {name: Polygon(shape.at(name, level)) for name in ("tibia", "fibula")}
    veins = {vein.name: Point(vein.position[:2]) for vein in default_veins(shape, level)}
    assert set(veins) == {"posterior tibial", "fibular", "anterior tibial"}
    for point in veins.values():
        assert hull.contains(point)
        assert min(bone.distance(point) for bone in bones.values()) > 2.0
    assert bones["tibia"].distance(veins["posterior tibial"]) < GAP + 1.0
    assert bones["fibula"].distance(veins["fibular"]) < GAP + 1.0
    # The calf's muscle lies behind the bones: +y here.
    assert veins["posterior tibial"].y > veins["anterior tibial"].y

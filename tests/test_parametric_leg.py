"""Parametric legs: the six of legfem, what their numbers do, bad files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely

from legfem.common.errors import InputError
from legfem.geometry.leg_shape import LegShape, fat_thickness_around, largest_girth, perimeter
from studies.making.shapes import ParametricLeg, horizontal_curvature, parametric_leg, read_legs

LEGS = Path(__file__).resolve().parents[1] / "studies" / "stockings" / "legs.toml"


@pytest.fixture(scope="module")
def legs() -> dict[str, tuple[ParametricLeg, LegShape]]:
    return {name: (leg, parametric_leg(leg, 72)) for name, leg in read_legs(LEGS).items()}


def test_the_six_legs_have_the_girths_and_fat_they_ask_for(legs):
    assert list(legs) == ["1", "2", "3", "4", "5", "6"]
    for leg, shape in legs.values():
        around = perimeter(shape)
        assert around.max() == pytest.approx(leg.girth_mm, rel=2e-3)
        assert around[[0, -1]] == pytest.approx([leg.girth_below_mm, leg.girth_above_mm], rel=2e-3)
        assert largest_girth(shape) == pytest.approx(leg.peak * leg.length_mm, abs=5)
        fat = fat_thickness_around(shape)
        assert fat.min() == pytest.approx(leg.shin_fat_mm, rel=0.2)
        assert fat.max() / leg.fat_mm == pytest.approx(1 + leg.fat_variation, rel=0.12)
        assert 19 < leg.weight_kg / leg.height_m**2 < 24


def test_the_legs_differ_in_what_the_study_asks_about(legs):
    fat = [fat_thickness_around(shape).mean() for _, shape in legs.values()]
    assert max(fat) > 2 * min(fat)
    curvature = [horizontal_curvature(shape) for _, shape in legs.values()]
    assert min(c.min() for c in curvature) < 0 < max(c.min() for c in curvature)
    assert 0.02 < min(c.max() for c in curvature) < 0.03 < max(c.max() for c in curvature) < 0.06


def test_the_tibia_is_close_to_the_shin_and_the_fibula_on_its_side(legs):
    leg, shape = legs["3"]
    other = parametric_leg(leg.model_copy(update={"fibula_side": 1}), 120)
    for made, side in ((shape, -1), (other, 1)):
        skin, tibia, fibula = (made.at(part, 70.0) for part in ("skin", "tibia", "fibula"))
        assert np.sign(fibula[:, 0].mean() - tibia[:, 0].mean()) == side
        assert tibia[:, 1].mean() < fibula[:, 1].mean() < 0
        depth = shapely.Polygon(skin).exterior.distance(shapely.Polygon(tibia))
        assert 3.0 < depth < 8.0


def test_numbers_that_make_no_leg_give_one_line(legs):
    with pytest.raises(InputError, match="ParametricLeg"):
        parametric_leg(legs["1"][0].model_copy(update={"tibia_mm": 60.0}))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("girth_mm", "girt_mm"), r"legs.1.girt_mm: .*girth_mm"),
        (("fat_mm = 8.5", "fat_mm = -8.5"), r"legs.1.fat_mm: -8.5 is out of range; give a value above 0"),
        (("[legs.1]", "[legs.1"), "TOML"),
    ],
)
def test_a_bad_file_gives_one_line(tmp_path, change, message):
    path = tmp_path / "legs.toml"
    path.write_text(LEGS.read_text().replace(*change, 1))
    with pytest.raises(InputError, match=message) as caught:
        read_legs(path)
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="not found"):
        read_legs(tmp_path / "none.toml")

"""What can't be in a leg and its stocking is refused; what is unlikely is doubted, by its field."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from making_stocking import laws, write_scanned

from legfem.common.errors import InputError
from legfem.common.progress import Silent
from legfem.geometry.leg_shape import LegShape, perimeter
from legfem.imaging.same_leg import check_scans_differ
from legfem.mechanics.materials import NeoHookean
from legfem.stockings.contour_distances import ContourAccuracy
from legfem.stockings.fabric import Stocking
from legfem.stockings.leg import Posture, StockingLeg
from legfem.stockings.levels import MakersLevels
from legfem.stockings.loading import LEAST_LENGTH_MM, doubts_about_leg, load_leg
from studies.making.shapes import parametric_leg, read_legs
from studies.stockings.command import LEGS

TOML = Path("leg.toml")

type Change = Callable[[StockingLeg], StockingLeg]


def _scaled(shape: LegShape, factor: float) -> LegShape:
    return LegShape(shape.levels, {part: factor * xy for part, xy in shape.contours.items()})


@pytest.fixture(scope="module")
def leg() -> StockingLeg:
    """In a fabric that it stretches by half all along, which presses with some 20 mmHg."""
    shape = parametric_leg(read_legs(LEGS)["1"], n_points=90)
    stocking = Stocking(0.3, shape.levels, perimeter(shape) / 1.5)
    return StockingLeg(
        "a",
        "A leg",
        "simulated",
        shape,
        shape,
        _scaled(shape, 0.99),
        None,
        stocking,
        ContourAccuracy(),
        laws(3.0, 8.0),
        True,
        "held",
        shape.levels[[5, 6]],
        (),
    )


def test_a_usual_leg_in_a_usual_stocking_is_not_doubted(leg):
    assert tuple(doubts_about_leg(leg, TOML)) == ()


def _resized(factor: float) -> Change:
    def change(leg: StockingLeg) -> StockingLeg:
        fabric = replace(leg.stocking, unstretched=factor * leg.stocking.unstretched)
        shapes = {name: _scaled(getattr(leg, name), factor) for name in ("bare", "compressed")}
        return replace(leg, stocking=fabric, **shapes)

    return change


def _tissue(name: str, **numbers: float) -> Change:
    def change(leg: StockingLeg) -> StockingLeg:
        law = leg.tissues[name]
        assert isinstance(law, NeoHookean)
        return replace(leg, tissues={**leg.tissues, name: replace(law, **numbers)})

    return change


def _compressed(factor: float) -> Change:
    return lambda leg: replace(leg, compressed=_scaled(leg.bare, factor))


def _fabric(stretch: float = 1.5, stiffness: float = 0.3) -> Change:
    return lambda leg: replace(leg, stocking=Stocking(stiffness, leg.bare.levels, perimeter(leg.bare) / stretch))


def _shortened(length: float) -> Change:
    """Return a cut of leg and scans to a length about their middle."""

    def change(leg: StockingLeg) -> StockingLeg:
        middle = float(leg.bare.levels.mean())
        levels = np.linspace(middle - length / 2, middle + length / 2, 16)
        cut = {name: getattr(leg, name).at_levels(levels) for name in ("bare", "scanned_bare", "compressed")}
        return replace(leg, **cut)

    return change


def _table(low: float, high: float) -> Change:
    """Return a change of the levels at which the fabric is known."""

    def change(leg: StockingLeg) -> StockingLeg:
        levels = np.linspace(low, high, 5)
        around = np.interp(levels, leg.bare.levels, perimeter(leg.bare))
        return replace(leg, stocking=Stocking(0.3, levels, around / 1.5))

    return change


def _wide_at_one_level(leg: StockingLeg) -> StockingLeg:
    around = leg.stocking.unstretched.copy()
    around[3] *= 4.0
    return replace(leg, stocking=Stocking(0.3, leg.stocking.levels, around))


def _heart(above: float) -> Change:
    return lambda leg: replace(leg, posture=Posture(float(leg.bare.levels[-1]) + above))


def _makers(height: float) -> Change:
    return lambda leg: replace(leg, makers=MakersLevels(heights={"D": height}))


@pytest.mark.parametrize(
    ("change", "field", "words"),
    [
        (_resized(0.6), "bare", "a girth of"),
        (_resized(0.75), "bare", "a tibia's width"),
        (_resized(1.8), "bare", "both are large"),
        (_shortened(75.0), "segment", "is 75 mm long: what its end faces do"),
        (_tissue("deep", D1=150.0), "tissues.deep.D1_per_MPa", "a D1 of 150"),
        (_tissue("superficial", C10=0.1), "tissues.superficial.C10_kPa", "C10 of 100 kPa"),
        (_tissue("deep", C10=40e-3), "tissues.deep.C10_kPa", "C10 of 40 kPa"),
        (_compressed(1.003), "compressed", "0.3 % thicker in its stocking"),
        (_table(20.0, 120.0), "stocking.unstretched", "leaves 20 mm"),
        (_fabric(2.8, 0.1), "stocking", "a stretch of the fabric of 180 %"),
        (_fabric(1.03, 5.0), "stocking", "a stretch of the fabric of 3 %"),
        (_fabric(1.5, 2.0), "stocking.stiffness_N_per_mm", "a mean pressure"),
        (_wide_at_one_level, "stocking.unstretched", "the fabric is wider than the leg at"),
        (_heart(200.0), "posture.heart_mm", "a heart's height above the leg's upper end of 200 mm"),
        (_makers(900.0), "stocking.levels_mm.D", "900 mm is not in the part that is modelled"),
    ],
)
def test_what_is_unlikely_is_doubted(leg, change, field, words):
    doubts = tuple(doubts_about_leg(change(leg), TOML))
    assert [doubt.field for doubt in doubts] == [field]
    assert words in doubts[0].problem


@pytest.mark.parametrize(
    ("change", "field", "words"),
    [
        (_resized(0.2), "bare", "a girth of"),
        (_resized(10.0), "bare", "a girth of"),
        (_tissue("deep", D1=5e3), "tissues.deep.D1_per_MPa", "if the value is in 1/GPa"),
        (_tissue("superficial", C10=8.0), "tissues.superficial.C10_kPa", "if the value is in Pa"),
        (_compressed(1.02), "compressed", "are the scans of [bare] and [compressed] exchanged?"),
        (_table(500.0, 640.0), "stocking.unstretched", "in its coordinates"),
        (_fabric(0.95), "stocking.unstretched", "is wider than the leg"),
        (_fabric(4.5), "stocking", "a stretch of the fabric of 350 %"),
        (_fabric(1.5, 300.0), "stocking.stiffness_N_per_mm", "if the value is in N/m"),
        (_heart(-100.0), "posture.heart_mm", "of -100 mm"),
    ],
)
def test_what_cannot_be_is_refused(leg, change, field, words):
    with pytest.raises(InputError) as caught:
        tuple(doubts_about_leg(change(leg), TOML))
    assert caught.value.field == field
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_a_doubt_of_a_short_segment_names_the_least_length_which_is_not_doubted(leg):
    (doubt,) = tuple(doubts_about_leg(_shortened(40.0)(leg), TOML))
    assert f"model {LEAST_LENGTH_MM:g} mm or more" in doubt.remedy and "segment" in str(doubt)
    assert tuple(doubts_about_leg(_shortened(LEAST_LENGTH_MM)(leg), TOML)) == ()


def test_stiffness_that_is_only_a_start_is_not_doubted(leg):
    unknown = replace(_tissue("deep", C10=40e-3)(leg), known=False)
    assert tuple(doubts_about_leg(unknown, TOML)) == ()


def test_a_straight_tube_is_known_at_every_height(leg):
    tube = Stocking(0.3, leg.bare.levels[:1], np.array([perimeter(leg.bare).min() / 1.4]))
    assert not [d for d in tuple(doubts_about_leg(replace(leg, stocking=tube), TOML)) if "table" in str(d)]


def test_one_scan_given_twice_is_refused_and_a_second_one_is_not(leg):
    with pytest.raises(InputError, match="compressed: is the same scan as"):
        check_scans_differ(leg.bare, leg.bare, TOML)
    again = {part: xy + 0.01 for part, xy in leg.bare.contours.items()}
    check_scans_differ(leg.bare, LegShape(leg.bare.levels, again), TOML)
    check_scans_differ(leg.bare, leg.bare.at_levels(leg.bare.levels[2:]), TOML)


_PLACES = "veins = [{name = 'v', position_mm = [%s]}]\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            _PLACES % "900, 0, 70",
            "veins v, position_mm: 900, 0, 70 is not in the part of the leg that is modelled, 50 to 110",
        ),
        (_PLACES % "0, 0, 700", "veins v, position_mm: 0, 0, 700 is not in the part"),
        (
            "veins = [{name = 'a', position_mm = [0, 0, 70]}, {name = 'a', position_mm = [9, 0, 70]}]\n",
            "'a' stands 2 times",
        ),
        ('veins = [{name = "a\\u0000b", position_mm = [0, 0, 70]}]\n', "veins.0.name"),
        ("stocking.levels_mm = {B = 110, C = 60}\n", "levels_mm.C: 60 mm is not above B, which is at 110 mm"),
        ("stocking.limits_percent = {C = [90, 20]}\n", "limits_percent.C: 90 to 20 is no range"),
    ],
)
def test_what_a_leg_s_file_places_is_in_the_leg_and_in_order(tmp_path: Path, text: str, words: str):
    toml = write_scanned(tmp_path) / "leg.toml"
    toml.write_text(text + toml.read_text())
    with pytest.raises(InputError) as caught:
        load_leg(tmp_path)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("levels", "words"), [((110, 80, 50), ""), ((50, 80, 80, 110), "the level 80 mm is given twice")], ids=str
)
def test_a_fabric_s_table_may_be_in_any_order_but_has_each_level_once(tmp_path: Path, levels, words: str):
    toml = write_scanned(tmp_path) / "leg.toml"
    toml.write_text(toml.read_text().replace('stocking.compression_class = "2"', 'stocking.unstretched = "fabric.csv"'))
    (tmp_path / "fabric.csv").write_text("level_mm,perimeter_mm\n" + "".join(f"{z},{100 + z}\n" for z in levels))
    try:
        np.testing.assert_array_equal(load_leg(tmp_path).stocking.unstretched, [150.0, 180.0, 210.0])
        assert not words
    except InputError as error:
        assert words and words in str(error)


class Stages(Silent):
    """Progress whose stages are kept."""

    def __init__(self) -> None:
        self.told: list[str] = []

    def stage(self, text: str, total: int | None = None) -> None:
        self.told.append(text)


def test_loading_says_before_it_reads_scans_that_too_little_of_the_leg_is_asked_for(tmp_path: Path):
    toml = write_scanned(tmp_path) / "leg.toml"
    toml.write_text(toml.read_text() + "segment = {from_mm = 60, to_mm = 105}\n")
    stages = Stages()
    load_leg(tmp_path, stages)
    assert stages.told == ["outlines of the bare leg, 45 mm of it as [segment] asks; model 80 mm or more"]

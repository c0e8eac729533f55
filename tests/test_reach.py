"""The study of random legs: what is drawn, how curves are compared, what is told."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from legfem.geometry.section import girth, minimal_fat_thickness
from legfem.mechanics.materials import ReducedPolynomial
from legfem.solve.path import ForceCurve
from studies.cases.__main__ import app
from studies.cases.reach import Reached, differences, drawn_leg, page
from studies.counting import Work


def test_legs_are_drawn_within_their_ranges_and_alike_for_one_seed():
    ranges = {
        "girth_mm": (250, 450),
        "fat_mm": (1, 25),
        "fascia_mm": (0.2, 1.5),
        "C10_kPa": (0.05, 10),
        "C20_kPa": (0, 40),
        "fat_kPa": (0.5, 20),
        "fascia_kPa": (10, 1e4),
        "D1_per_MPa": (5, 60),
        "outer_D1_per_MPa": (5, 60),
        "depth_mm": (0, 30),
        "radius_mm": (7.5, 20),
    }
    legs = [drawn_leg(number, 5) for number in range(12)]
    for leg, test in legs:
        for name, (low, high) in ranges.items():
            assert low <= getattr(leg, name) <= high, name
        assert leg.C20_kPa <= 4 * leg.C10_kPa
        assert girth(test.section) == pytest.approx(leg.girth_mm, rel=1e-3)
        assert 0.5 * leg.fat_mm < minimal_fat_thickness(test.section) <= 1.01 * leg.fat_mm
        deep = test.tissues.deep
        assert isinstance(deep, ReducedPolynomial) and deep.C10 == 1e-3 * leg.C10_kPa
    assert {leg.C20_kPa == 0 for leg, _ in legs} == {True, False}
    again, other = drawn_leg(3, 5), drawn_leg(3, 6)
    assert again[0] == legs[3][0] != other[0]
    np.testing.assert_array_equal(again[1].section.skin, legs[3][1].section.skin)


def test_the_spline_s_error_is_told_apart_from_that_of_the_steps():
    def curve(number: int, factor: float = 1.0) -> ForceCurve:
        d = np.linspace(0.0, 6.0, number)
        return ForceCurve(d, factor * (1 / (8 - d) ** 2 - 1 / 64))

    between, at_steps = differences(curve(7), curve(61))
    assert between > 1e-3 and at_steps < 1e-4
    between, at_steps = differences(curve(61, 1.01), curve(61))
    assert between == pytest.approx(0.01) == at_steps


def _took(factorisations: int) -> Work:
    return Work({"factorisations": factorisations, "iterations": 264, "residuals": 290}, 2.0, {})


def _outcome(**given: object) -> Reached:
    leg, _ = drawn_leg(0, 5)
    usual = Reached(leg, True, leg.depth_mm, "the target is reached", 1, 0, 23, _took(80))
    return replace(usual, **given)


def test_the_page_counts_and_names_legs_that_stop():
    found = [
        _outcome(between=0.001, at_steps=0.0005),
        _outcome(between=0.004, at_steps=0.001),
        _outcome(jumps=2),
        _outcome(complete=False, reached_mm=12.5, reason="it folded", work=_took(330)),
    ]
    text = page(found)
    assert "3/4 = 75 %" in text.replace("%", " %").replace("  ", " ")
    assert "1/2" in text and "0.40 %" in text and "0.10 %" in text
    assert "it folded" in text and "12.50" in text
    assert [80, 255, 330] == [float(one) for one in re.search(r"factorisations \|(.*)\|", text)[1].split("|")]


@pytest.mark.slow
def test_a_second_run_goes_on_where_the_first_stopped(tmp_path: Path):
    def run(number: int) -> list[dict]:
        asked = ["reach", "--n", str(number), "--seed", "5", "--jobs", "1"]
        ended = CliRunner().invoke(app, [*asked, "--out", str(tmp_path)])
        assert ended.exit_code == 0, ended.output
        return json.loads((tmp_path / "result.json").read_text())["cases"]

    (first,) = run(1)
    again, second = run(2)
    assert again == first and first["complete"]
    assert second["leg"]["number"] == 1 and second["work"]["counts"]["factorisations"] > 20

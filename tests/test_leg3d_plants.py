"""Legs drawn at random for the study of legs in 3D."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from legfem.common.progress import Silent
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.estimates import Shown
from studies.cases.outcomes import Interval
from studies.leg3d import __main__ as study
from studies.leg3d import plants
from studies.leg3d.__main__ import app
from studies.leg3d.plants import SOFTEST, STIFFEST, PlantResult, counted, drawn, plant_result, plant_row

MODELS = ("3d", "2d, the table's nearest leg", "2d, no correction")


def test_plants_are_drawn_alike_from_a_seed_over_the_range_by_both_laws():
    legs = [drawn(number, 1) for number in range(40)]
    assert legs == [drawn(number, 1) for number in range(40)]
    c10 = np.array([leg.c10 for leg in legs])
    assert SOFTEST <= c10.min() < 0.7 and 2.3 < c10.max() <= STIFFEST
    assert all((leg.c20 > 0) == bool(number % 2) for number, leg in enumerate(legs))


@pytest.mark.parametrize("factor", [1.0, 1.5])
def test_a_plant_is_identified_once_and_told_by_whether_it_is_held(tmp_path, monkeypatch, factor):
    planted, calls = drawn(1, 1), []

    def one(value: float) -> SimpleNamespace:
        at = 1e-3 * factor * value
        shown = Shown(1e3 * at, 1.0, (900 * at, 1100 * at), "kPa")
        return SimpleNamespace(shown=shown)

    def identified(*asked):
        calls.append(asked)
        parameters = {DEEP_C10: one(planted.c10), DEEP_C20: one(planted.c20)}
        evidence = SimpleNamespace(full_solves=3)
        details = SimpleNamespace(spatial=evidence)
        return {name: SimpleNamespace(estimates=parameters, details=details) for name in MODELS}

    monkeypatch.setattr(plants, "identified", identified)
    results = [plant_result(planted, 1, tmp_path, Silent()) for _ in range(2)]
    assert len(calls) == 1 and results[0] == results[1]
    missed = factor != 1.0
    assert ("missed" in " ".join(plant_row(1, planted, results[0]))) == missed
    held = 0 if missed else 1
    words = f"C10 in its interval in {held} of 1, C20 in {held} of 1."
    assert counted([planted], results[:1]) == words


def test_many_plants_have_a_row_each(tmp_path, monkeypatch):
    def found(planted, seed, *_):
        one = Interval(planted.c10, planted.c10 - 0.01 * seed, planted.c10 + 0.01 * seed)
        return PlantResult({name: one for name in MODELS}, {}, 3, 1.0)

    monkeypatch.setattr(study, "plant_result", found)
    told = CliRunner().invoke(app, ["--plants", "4", "--out", str(tmp_path)])
    assert told.exit_code == 0, told.output
    rows = [row for row in told.output.splitlines() if row.startswith("| ") and row[2].isdigit()]
    assert [row.split()[1] for row in rows] == ["1", "2", "3", "4"]


@pytest.mark.parametrize("other", [["--c10", "2"], ["--fibres", "3"]])
def test_many_plants_don_t_pass_over_what_is_asked_of_one(tmp_path, other):
    asked = ["--plants", "2", *other, "--out", str(tmp_path / "out")]
    told = CliRunner().invoke(app, asked)
    assert told.exit_code == 2
    assert "--plants" in told.output and "leave --c10" in told.output

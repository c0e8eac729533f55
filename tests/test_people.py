"""Fat and muscle of people: reading, springs, the hierarchical fit, and people left out."""

from __future__ import annotations

import runpy
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from making_people import MEDIANS, losses, people

from legfem.common.errors import InputError
from studies.people.data import Indentations, read_indentations
from studies.people.population import draw_population
from studies.people.prediction import (
    least_share,
    least_share_value,
    least_squares,
    left_out,
    mean_error,
    predict_left_out,
)
from studies.people.probe import Losses, allowed

DATA = Path(__file__).parents[2] / "shared" / "data" / "multis_in_vivo"


@pytest.fixture(scope="module")
def made() -> tuple[Indentations, np.ndarray, Losses]:
    rows, theta = people(40, 7)
    return rows, theta, losses(rows)


@pytest.fixture(scope="module")
def drawn(made):
    return draw_population(made[2], 300, 300, np.random.default_rng(1), thin=2)


def table(**changed) -> pd.DataFrame:
    row = {
        "SubID": "006",
        "Location": "LL_P",
        "MaxForce": 6.75,
        "maxForce_normArea": 0.01,
        "Thickness": 50.0,
        "Skin": 1.5,
        "Fat": 8.5,
        "Muscle": 40.0,
        "SkinStrain": 0.1,
        "fat_disp": 0.85,
        "muscle_disp": 6.0,
        "Total_Stiff": 0.00125,
    }
    return pd.DataFrame([row, row | {"SubID": "007"} | changed])


def test_the_table_s_numbers_are_those_of_layers(tmp_path):
    table(maxForce_normArea=6.75 / 360).to_csv(tmp_path / "indentation.csv", index=False)
    rows = read_indentations(tmp_path)
    assert rows.people == ("006", "007") and rows.sites == ("LL_P",)
    np.testing.assert_allclose(rows.area, [675.0, 360.0])
    np.testing.assert_allclose(rows.superficial, 10.0)
    np.testing.assert_allclose(rows.superficial_loss, 1.0)
    np.testing.assert_allclose(rows.compliance, 800.0)
    np.testing.assert_allclose(rows.secant_compliance, [7.0 / 0.01, 7.0 * 360 / 6.75])


@pytest.mark.parametrize("changed", [{"Thickness": ""}, {"MaxForce": "-"}, {"Fat": 0.0}, {"Location": "elsewhere"}])
def test_rows_without_a_number_are_left_out(tmp_path, changed):
    table(**changed).to_csv(tmp_path / "indentation.csv", index=False)
    assert read_indentations(tmp_path).people == ("006",)


def test_a_table_without_a_column_is_refused(tmp_path):
    table().drop(columns="Muscle").to_csv(tmp_path / "indentation.csv", index=False)
    with pytest.raises(InputError, match="Muscle"):
        read_indentations(tmp_path)


def test_without_data_the_command_says_so_and_writes_nothing(tmp_path, monkeypatch, capsys):
    out = tmp_path / "out"
    given = ["people", "--data", str(tmp_path), "--out", str(out)]
    monkeypatch.setattr(sys, "argv", given)
    monkeypatch.delitem(sys.modules, "studies.people.__main__", raising=False)
    with pytest.raises(SystemExit) as ended:
        runpy.run_module("studies.people", run_name="__main__")
    assert ended.value.code == 2 and not out.exists()
    assert "indentation.csv" in capsys.readouterr().err


def test_springs_find_the_softness_that_made_the_compliance():
    rng = np.random.default_rng(0)
    layers = rng.uniform(3, 40, (30, 2))
    exact = layers @ [20.0, 5.0]
    for fit in (least_squares, least_share):
        np.testing.assert_allclose(fit(layers, exact), [20.0, 5.0], rtol=1e-3)


def test_the_least_relative_error_is_the_least():
    rng = np.random.default_rng(3)
    layers = rng.uniform(3, 40, (25, 2))
    compliance = layers @ [20.0, 5.0] * np.exp(0.4 * rng.standard_normal(25))

    def error(soft):
        return np.mean(np.abs(layers @ soft / compliance - 1))

    found = least_share(layers, compliance)
    near = found * np.exp(0.1 * rng.standard_normal((400, 2)))
    assert error(found) <= min(error(soft) for soft in near) + 1e-3
    assert error(found) < error(least_squares(layers, compliance))
    values = rng.lognormal(0, 0.5, 41)
    best = least_share_value(values)
    trials = np.linspace(0.3, 3.0, 500)
    assert np.mean(np.abs(best / values - 1)) <= np.abs(trials[:, None] / values - 1).mean(1).min()


def test_springs_of_a_person_left_out_don_t_know_the_person(made):
    rows = made[0]
    told = left_out(rows, rows.compliance, least_squares)
    own = rows.person == 5
    changed = np.where(own, 9.0 * rows.compliance, rows.compliance)
    np.testing.assert_array_equal(left_out(rows, changed, least_squares)[own], told[own])


def test_thickness_lost_depends_on_force_over_stiffness(made):
    rows, theta, tables = made
    once = tables(theta)
    again = tables(theta + np.log(3.0), 3.0 * rows.force)
    np.testing.assert_allclose(again, once, rtol=1e-9)


def test_tables_return_what_the_model_says(made):
    """The boundaries' errors aside: made without, the losses are those of the closed form."""
    rows, theta = people(30, 11, noise=0.0)
    kept = allowed(theta)
    superficial, total = losses(rows)(theta)
    # Beyond the greatest strain that was solved the tables go on by their last slope.
    kept &= total < 0.34 * (rows.superficial + rows.deep)
    assert kept.sum() > 40
    # A tenth of what an image is misread by.
    np.testing.assert_allclose(superficial[kept], rows.superficial_loss[kept], atol=0.02)
    np.testing.assert_allclose(total[kept], (rows.superficial_loss + rows.deep_loss)[kept], atol=0.02, rtol=0.01)


def test_the_population_s_medians_are_found(drawn):
    """Of skewed and heavy-tailed people read with uniform errors, within three of its own sd."""
    site = drawn["site"]
    off = (site.mean(axis=0) - MEDIANS) / site.std(axis=0)
    print(off, np.exp(site.mean(axis=0)) * 1e3)
    assert (np.abs(off) < 3).all()
    assert (site.std(axis=0) < 0.2).all()


def test_how_people_differ_is_found(made, drawn):
    _, theta, _ = made
    true = np.array([np.var(theta[k::2] - MEDIANS[k], axis=0) for k in range(2)]).mean(axis=0)
    found = np.diagonal(drawn["spread"], axis1=1, axis2=2)
    low, high = np.quantile(found, (0.005, 0.995), axis=0)
    print(true, low, high)
    assert (low < true).all() and (true < high).all()


def test_a_person_s_interval_holds_the_truth(made, drawn):
    """95 % of 160; by chance four standard deviations fewer are 88 %."""
    _, theta, _ = made
    low, high = np.quantile(drawn["theta"], (0.025, 0.975), axis=0)
    held = ((low < theta) & (theta < high)).mean()
    print(held)
    assert held > 0.88


def test_people_left_out_are_predicted_better_than_by_springs(made, drawn):
    rows, _, tables = made
    told = predict_left_out(tables, rows.compliance, drawn.states[-1], 0)
    mechanics = mean_error(rows, rows.compliance, told.best).mean()
    springs = mean_error(rows, rows.compliance, left_out(rows, rows.compliance, least_share)).mean()
    within = ((rows.compliance > told.low) & (rows.compliance < told.high)).mean()
    print(mechanics, springs, within, told.expected_error.mean())
    assert mechanics < springs
    assert 0.78 < within < 0.99
    assert mechanics == pytest.approx(told.expected_error.mean(), rel=0.3)


def test_a_person_left_out_tells_nothing_of_the_prediction(made, drawn):
    rows, _, tables = made
    own = rows.person == 0
    changed = replace(
        rows,
        force=np.where(own, 2.0 * rows.force, rows.force),
        superficial_loss=np.where(own, 0.0, rows.superficial_loss),
        deep_loss=np.where(own, 9.0, rows.deep_loss),
    )
    few = np.isin(rows.person, range(8))  # two groups
    before, after = (
        predict_left_out(Losses(one, tables.tables).where(few), rows.compliance[few], drawn.states[-1], 0).best[:2]
        for one in (rows, changed)
    )
    np.testing.assert_array_equal(before, after)


@pytest.mark.slow
@pytest.mark.skipif(not DATA.is_dir(), reason="the data of MULTIS aren't here")
def test_real_people_are_predicted_better_than_by_springs(tmp_path, monkeypatch):
    from studies.people import __main__ as command
    from studies.people.probe import ProbeModel

    monkeypatch.setattr(command, "POINTS", 100)
    monkeypatch.setattr(command, "CHECKED", 20)
    found = command.find(read_indentations(DATA), ProbeModel(), tmp_path, 1, 0)
    mechanics, springs = found.errors["mechanics"], found.errors["two springs"]
    print(command.errors_table(found))
    calf = found.rows.sites.index(command.CALF)
    assert mechanics.mean() < springs.mean() and mechanics[calf] < springs[calf]
    assert found.emulator_error[0] < 0.06

"""The design of experiments: statistics against planted truths, definitions."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from making_doe import TOML, definition, planted_table
from typer.testing import CliRunner

from legfem.commands.study import app
from legfem.solve.path import ForceCurve
from legfem.study.doe.design import IDENTIFIED, PAPER, Factor, factorial_design, read_definition, space_filling_design
from legfem.study.doe.runs import Metric, metrics_in
from legfem.study.doe.study import analyse
from legfem.study.doe.surface import NotEstimableError, analyse_metric, lenth_of
from studies.frauziols.claims import ERROR_DOF, MODEL_DOF, TABLE_2, TABLE_3, ClaimFinding, _in_words, table_3_cells

SLOPE = Metric("slope", 0.0, 5.0)


# --- statistics ---


def test_planted_polynomial_is_recovered_and_agrees_with_statsmodels() -> None:
    given, table, truth = planted_table(noise=0.05)
    surface = analyse_metric(table, given.factors, SLOPE)
    found, tests = surface.anova, surface.tests
    assert (found.model_dof, found.error_dof) == (15, 17)
    assert found.F == pytest.approx(surface.fit.fvalue)
    assert found.p_value == pytest.approx(surface.fit.f_pvalue)
    assert found.r_squared == pytest.approx(surface.fit.rsquared)
    assert found.ssr + found.sse == pytest.approx(float(np.var(table["slope_0_5"])) * 33)
    assert len(tests) == 16
    for test in tests:
        assert test.value == pytest.approx(truth[test.term], abs=4 * test.standard_error)
        assert test.t == pytest.approx(surface.fit.tvalues[test.term])
        assert test.p_value == pytest.approx(surface.fit.pvalues[test.term])
        runs = 33 if test.term == "Intercept" else 32
        assert test.standard_error == pytest.approx(np.sqrt(found.mse / runs))
    assert found.predicted_r_squared < found.r_squared


def rounding(printed: str) -> np.ndarray:
    """Return the least and the greatest number that are printed like this."""
    value = Decimal(printed)
    half = Decimal(5).scaleb(int(value.as_tuple().exponent) - 1)
    return np.array([value - half, value + half], dtype=float)


def within(value: float, above: np.ndarray, below: np.ndarray) -> bool:
    """Return whether a value can be the ratio of two numbers known to their rounding."""
    return bool(above[0] / below[1] <= value <= above[1] / below[0])


def test_printed_table_3_used_15_and_17_and_has_one_misprint() -> None:
    assert [row.metric for row in TABLE_3] == [metric.name for metric in metrics_in(((0, 5), (5, 20), (20, 30)))]
    misprinted = []
    for row in TABLE_3:
        ssr, msr, sse, mse, r_squared = (rounding(v) for v in (row.ssr, row.msr, row.sse, row.mse, row.r_squared))
        assert within(ERROR_DOF, sse, mse)
        assert ssr[0] / (ssr[0] + sse[1]) <= r_squared[1]
        assert r_squared[0] <= ssr[1] / (ssr[1] + sse[0])
        # Neither does the text's p = 5 explain any row.
        assert not within(4, ssr, msr) and not within(28, sse, mse)
        if not within(MODEL_DOF, ssr, msr):
            misprinted.append(row.metric)
            assert float(row.ssr) / MODEL_DOF == pytest.approx(1.2e-5)
    assert misprinted == ["curvature_20_30"]


def test_the_table_beside_the_papers_halves_curvatures_only() -> None:
    given, table, _ = planted_table(noise=0.05)
    done, _ = analyse(given, table)
    result = cast(Any, SimpleNamespace(definition=given, analyses=done))
    _, rows = table_3_cells(result)
    assert [row[0] for row in rows].count("half of it") == 3 and len(rows) == 9
    own = [float(row[1].split("/")[1]) for row in rows]
    assert own[0] == pytest.approx(done[0].anova.ssr, rel=0.05)
    assert own[1] == pytest.approx(done[0].anova.ssr / 4, rel=0.05)
    assert own[-1] == pytest.approx(done[-1].anova.ssr, rel=0.05)
    narrow = replace(given, factors=(*given.factors[:-1], replace(given.factors[-1], high=0.9)))
    assert not table_3_cells(cast(Any, SimpleNamespace(definition=narrow, analyses=done)))


def test_lenth_tells_active_effects_from_noise() -> None:
    given, table, _ = planted_table(noise=0.0)
    rng = np.random.default_rng(1)
    s = [f.symbol for f in given.factors]
    for metric in metrics_in(given.windows):
        table[metric.name] = 5 + 3 * table[s[1]] + table[s[1]] * table[s[2]] * table[s[3]]
        table[metric.name] += 0.05 * rng.standard_normal(33)
    done, not_done = analyse(given, table)
    assert not not_done
    for analysis in done:
        found = analysis.lenth
        assert found is not None
        beyond = {
            term
            for term, value in zip(found.terms, found.values, strict=True)
            if abs(value) > found.simultaneous_margin
        }
        assert beyond == {s[1], ":".join(s[1:4])}
        assert found.margin < found.simultaneous_margin
        assert analysis.centre is not None and analysis.centre.p_value > 0.001
    errors = [a.lenth.pseudo_standard_error for a in done if a.lenth is not None]
    assert np.mean(errors) == pytest.approx(0.05 / np.sqrt(32), rel=0.25)


def test_lenths_limits_of_seven_contrasts() -> None:
    found = lenth_of(tuple("abcdefg"), np.array([1.0, -2, 3, -4, 5, 100, -100]))
    # Median 4, limit 2.5 x 6; the median of those below it is 3. Lenth's table: 3.764, 9.008.
    assert found.pseudo_standard_error == pytest.approx(4.5)
    assert found.margin == pytest.approx(3.764 * 4.5, rel=1e-3)
    assert found.simultaneous_margin == pytest.approx(9.008 * 4.5, rel=1e-3)


def test_the_centre_shows_squares_and_its_share_of_the_error() -> None:
    given, table, _ = planted_table(noise=1e-3)
    bent = table.copy()
    for metric in metrics_in(given.windows):
        bent[metric.name] += 2.0 * table[given.factors[0].symbol] ** 2
    (analysis, *_), _ = analyse(given, bent)
    assert analysis.centre is not None
    assert analysis.centre.difference == pytest.approx(2.0, abs=0.01)
    assert analysis.centre.p_value < 1e-6
    corners = analyse_metric(bent[:32], given.factors, analysis.metric)
    share = 1 - corners.fit.ssr / analysis.fit.ssr
    assert analysis.centre.share_of_sse == pytest.approx(share)
    assert analysis.residuals.shapiro < 0.01


def test_missing_runs_are_left_out_and_said() -> None:
    given, table, truth = planted_table(noise=1e-6)
    table.loc[2, "slope_20_30"] = np.nan
    done, _ = analyse(given, table)
    last = done[-1]
    assert last.missing == (3,) and last.anova.error_dof == 16 and last.lenth is None
    assert last.tests[1].value == pytest.approx(truth[last.tests[1].term], abs=1e-4)
    assert all(a.anova.error_dof == 17 and a.lenth is not None for a in done[:-1])
    table.loc[table[given.factors[0].symbol] > 0, "slope_20_30"] = np.nan
    with pytest.raises(NotEstimableError, match=r"confounded|coefficients need more"):
        analyse_metric(table, given.factors, done[-1].metric)
    done, not_done = analyse(given, table)
    assert len(done) == 5 and not_done[0][0].name == "slope_20_30"


def test_metrics_of_a_parabola() -> None:
    d = np.linspace(0, 30, 31)
    curve = ForceCurve(d, 0.3 * d + 0.02 * d**2)
    assert Metric("slope", 5, 20).of(curve) == pytest.approx(0.3 + 0.02 * 25)
    assert Metric("curvature", 5, 20).of(curve) == pytest.approx(0.04)
    assert np.isnan(Metric("slope", 20, 31).of(curve))


@pytest.mark.parametrize(
    ("findings", "words"),
    [
        ([True, True], "reproduced"),
        ([False, False], "not reproduced"),
        ([True, False], "holds only with a"),
        ([None, True], "reproduced"),
        ([None, None], "cannot be determined"),
    ],
)
def test_verdicts_in_words(findings: list[bool | None], words: str) -> None:
    assert _in_words(tuple(ClaimFinding(f, "", "") for f in findings), ["a", "b"]) == words


def test_a_verdict_names_its_condition() -> None:
    findings = (ClaimFinding(True, "", "", "fat is known"), ClaimFinding(True, "", "", "fat is known"))
    assert _in_words(findings, ["a", "b"]) == "holds only where fat is known"


# --- the design ---


def test_legfem_s_designs_are_the_papers_five_factors() -> None:
    paper, identified = read_definition(PAPER), read_definition(IDENTIFIED)
    assert [f.name for f in paper.factors] == [f.name for f in identified.factors]
    assert paper.factors == TABLE_2
    centre = {f.name: f.model_value(0.0) for f in paper.factors}
    assert centre["deep.C10"] == pytest.approx(15.25e-3)
    assert centre["fascia.C10"] == pytest.approx(5.05)
    assert np.unique(factorial_design(5), axis=0).shape == (33, 5)
    thickness = identified.factors[-1]
    assert thickness.value(0.0) == pytest.approx(np.sqrt(0.2))


def test_coding_and_space_filling() -> None:
    factor = Factor("fascia.C10", 0.1, 10.0, "MPa", "logarithmic")
    assert [factor.value(x) for x in (-1, 0, 1)] == pytest.approx([0.1, 1.0, 10.0])
    assert Factor("deep.C10", 1, 3, "kPa", "linear").model_value(0.0) == pytest.approx(2e-3)
    points = space_filling_design(3, 10, seed=1)
    assert points.shape == (10, 3) and np.abs(points).max() <= 1
    assert np.array_equal(points, space_filling_design(3, 10, seed=1))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"superficial.C10"', '"superfical.C10"', "did you mean 'superficial.C10'?"),
        ("high_kPa = 30.0", "high_kPa = 0.1", "reversed"),
        ("low_MPa = 0.1", "low_MPa = 10.0", "one level only"),
        ("low_MPa = 0.1", "low_mm = 0.1", "unknown key"),
        ("low_MPa = 0.1\n", "", "low_MPa: missing"),
        ("low_mm = 0.2", "low_mm = -0.2", "out of range"),
        ("low_mm = 0.2", "low_mm = 2000.0", "out of range"),
        ("low_mm = 0.2", 'low_mm = "thin"', "not a finite number"),
        ('"linear"', '"log"', "use 'linear' or 'logarithmic'"),
        ("[20, 30]", "[30, 20]", "not a part of 0 to 30 mm"),
        ("title =", "title", "TOML"),
        ("depth_mm", "depth", "did you mean 'depth_mm'?"),
    ],
)
def test_what_cannot_be_used_is_said_in_a_line(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in TOML
    path, out = definition(tmp_path, TOML.replace(old, new, 1)), tmp_path / "out"
    ran = CliRunner().invoke(app, ["doe", "--factors", str(path), "--out", str(out)])
    assert ran.exit_code == 2
    assert ran.output.count("\n") == 1 and said in ran.output and str(path) in ran.output
    assert not out.exists()


def test_missing_definition(tmp_path: Path) -> None:
    ran = CliRunner().invoke(app, ["doe", "--factors", str(tmp_path / "none.toml")])
    assert ran.exit_code == 2 and ran.output.count("\n") == 1 and "not found" in ran.output

"""Plain tables of readings: agreement against closed forms, statsmodels and published numbers; what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import statsmodels.api as sm
from scipy.stats import chi2
from statsmodels.formula.api import ols
from typer.testing import CliRunner

import legfem as lf
from legfem.commands.cohort import app

LARGE = [494, 395, 516, 434, 476, 557, 413, 442, 650, 433, 417, 656, 267, 478, 178, 423, 427]
MINI = [512, 430, 520, 428, 500, 600, 364, 380, 658, 445, 432, 626, 260, 477, 259, 350, 451]
"""Bland and Altman's two flow meters (1986), l/min."""


def written(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def flow(path: Path, error: str = "", mark: str = ",") -> Path:
    rows = [(f"P{k}", name, one) for name, each in (("large", LARGE), ("mini", MINI)) for k, one in enumerate(each)]
    head = mark.join(["Subject", "Method", "Flow (l/min)", *(["Error (l/min)"] if error else [])])
    lines = [mark.join([who, name, str(one), *([error] if error else [])]) for who, name, one in rows]
    return written(path, "\n".join([head, *lines]))


def test_two_methods_differ_as_bland_and_altman_say(tmp_path: Path) -> None:
    """Mini less large: 2.1 (-17.8 to 22.0), limits -73.9 and 78.1 l/min."""
    found = lf.cohort(table=flow(tmp_path / "flow.csv"), out=tmp_path / "out")
    (pair,) = found.found.parameters[0].repeated[0].pairs
    assert pair.levels == ("large", "mini") and found.found.parameters[0].unit == "l/min"
    assert (pair.limits.bias, *pair.limits.bias95) == pytest.approx((2.1, -17.8, 22.0), abs=0.1)
    assert (pair.limits.low, pair.limits.high) == pytest.approx((-73.9, 78.1), abs=0.1)
    assert "l/min" in found.summary() and len(found.plot().axes) == 1


def test_the_figures_are_those_of_an_analysis_of_variance(tmp_path: Path) -> None:
    """ICC(A,1), SEM and the detectable change from statsmodels' mean squares, in the values' own unit."""
    rng = np.random.default_rng(5)
    true = rng.normal(20, 4, 9)
    table = [(f"m{k}", visit, true[k] + 0.7 * visit + rng.normal(0, 1.1)) for k in range(9) for visit in (1, 2, 3)]
    data = pd.DataFrame(table, columns=["member", "visit", "value [kPa]"])
    data.to_csv(tmp_path / "r.csv", index=False)
    squares = sm.stats.anova_lm(
        ols("value ~ C(member) + C(visit)", data.set_axis(["member", "visit", "value"], axis=1)).fit()
    )
    rows, columns, rest = squares["mean_sq"]
    icc = (rows - rest) / (rows + 2 * rest + 3 * (columns - rest) / 9)
    sem = np.sqrt((columns - rest) / 9 + rest)
    (line,) = lf.cohort(tmp_path / "r.csv", out=tmp_path / "out").to_frame().to_dict("records")
    assert (line["by"], line["unit"], line["targets"], line["levels"]) == ("session", "kPa", 9, 3)
    assert (line["icc"], line["sem"]) == pytest.approx((icc, sem), rel=1e-9)
    assert line["detectable"] == pytest.approx(1.96 * np.sqrt(2) * sem, rel=1e-9)


def test_own_errors_say_whether_two_methods_agree(tmp_path: Path) -> None:
    """Against the sum of squared differences over their variance, which is chi-square of 17."""
    squares = float(np.sum(np.subtract(LARGE, MINI) ** 2))
    for error in (27.4, 10.0, 80.0):
        path = flow(tmp_path / f"{error}.csv", f"{error}".replace(".", ","), ";")
        found = lf.cohort(path, out=tmp_path).found.parameters[0].repeated[0].pairs[0].p_value
        assert found == pytest.approx(chi2.sf(squares / (2 * error**2), 17), rel=1e-9)
    alone = lf.cohort(flow(tmp_path / "none.csv"), out=tmp_path).found.parameters[0]
    assert np.isnan(alone.repeated[0].pairs[0].p_value)


def test_each_methods_visits_are_compared_apart_from_another_methods(tmp_path: Path) -> None:
    """Both methods together would have a correlation of nearly 1, as one reads ten times what the other does."""
    rng = np.random.default_rng(1)
    rows = [
        f"{k},{visit},{name},{scale * rng.normal(10, 1):.4f}"
        for name, scale in (("probe", 1), ("other", 10))
        for k in range(10)
        for visit in (1, 2)
    ]
    path = written(tmp_path / "r.csv", "\n".join(["member,visit,method,value", *rows]))
    found = lf.cohort(path, out=tmp_path / "out").to_frame().set_index("what")
    assert found["by"].to_dict() == {"value": "method", "value by other": "session", "value by probe": "session"}
    assert found["icc"].max() < 0.8


def test_readings_that_agree_wholly_have_a_correlation_of_one(tmp_path: Path) -> None:
    rows = [f"{k},{visit},{10 + k}" for k in range(6) for visit in (1, 2)]
    path = written(tmp_path / "r.csv", "\n".join(["member,visit,value", *rows]))
    (line,) = lf.cohort(path, out=tmp_path / "out").to_frame().to_dict("records")
    assert (line["icc"], line["sem"], line["icc95"]) == (1.0, 0.0, (1.0, 1.0))


def test_readings_that_are_all_alike_have_no_correlation(tmp_path: Path) -> None:
    rows = [f"{k},{visit},10" for k in range(6) for visit in (1, 2)]
    path = written(tmp_path / "r.csv", "\n".join(["member,visit,value", *rows]))
    said = lf.cohort(path, out=tmp_path / "out").found.not_done
    assert "No agreement between sessions: all values are alike." in said


def test_the_command_writes_page_text_and_document(tmp_path: Path) -> None:
    path, out = flow(tmp_path / "flow.csv", "20"), tmp_path / "out"
    ran = CliRunner().invoke(app, ["--table", str(path), "--out", str(out)])
    assert ran.exit_code == 0 and "ICC" in ran.output and {one.name for one in out.iterdir()} >= {"cohort.html"}
    kept = json.loads((out / "cohort.json").read_text())
    assert kept["schema"] == "legfem.readings/1" and kept["statistics"]["parameters"][0]["name"] == "Flow"
    assert "Bland and Altman" in (out / "cohort.txt").read_text()


def test_readings_that_are_averaged_or_left_out_are_said(tmp_path: Path) -> None:
    rows = [f"{k},{visit},{10 + k + visit},x" for k in range(6) for visit in (1, 2, 2)]
    path = written(tmp_path / "r.csv", "\n".join(["member,visit,value,comment", *rows, "7,1,,"]))
    said = " ".join(lf.cohort(path, out=tmp_path / "out").found.not_done)
    assert "are averaged" in said and "left out: 20 (1)" in said


HEAD = "member,visit,value\n"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("who,visit,value\nP1,1,2\n", "header: there is no column member"),
        ("member,value\nP1,2\n", "header: there is no column one of visit, rater and method"),
        ("member,visit\nP1,2\n", "header: the readings stand in one of no column"),
        ("member,visit,probe,imaging\nP1,2,3,4\n", "one of probe, imaging; call one of them value"),
        ("member,subject,visit,value\nP1,P1,2,3\n", "two columns say the same"),
        ("member,visit,value (kPa),error (%)\nP1,1,3,4\n", r"error \(%\): has another unit than value \(kPa\)"),
        (HEAD + "P1,1,soft\n", "value, line 2: 'soft' is not a number"),
        (HEAD + "P1,1,inf\n", "value, line 2: 'inf' is not a number"),
        (HEAD + "P1,1,2\n,1,2\n", "member, line 3: is empty"),
        (HEAD + "P1,,2\n", "visit, line 2: is empty"),
        ("member,visit,value,error\nP1,1,2,0\n", "error, line 2: is 0; write a number above 0"),
        ("member,visit,value,error\nP1,1,2,\n", "error, line 2: is empty"),
        (HEAD, "rows: there are none"),
        ("", "is empty"),
    ],
)
def test_a_table_that_cannot_be_used_is_told_in_one_line(text: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(lf.InputError, match=told) as error:
        lf.cohort(table=written(tmp_path / "r.csv", text), out=tmp_path / "out")
    assert "\n" not in str(error.value)


def test_a_table_of_too_few_says_what_it_needs(tmp_path: Path) -> None:
    found = lf.cohort(table=written(tmp_path / "r.csv", HEAD + "P1,1,2\nP2,1,3\n"), out=tmp_path / "out")
    assert found.found.not_done[:1] == ("No agreement between sessions: the table has one session.",)
    assert found.to_frame().empty and "No agreement could be computed" in found.summary()
    with pytest.raises(ValueError, match="nothing to draw"):
        found.plot()


def test_options_of_a_fit_have_no_effect_on_readings_and_are_refused(tmp_path: Path) -> None:
    with pytest.raises(lf.InputError, match=r"law.*has no effect on a plain table"):
        lf.cohort(flow(tmp_path / "flow.csv"), law="both", out=tmp_path / "out")
    assert CliRunner().invoke(app, []).exit_code == 2


def test_columns_that_statistics_call_by_another_name_are_passed_over(tmp_path: Path) -> None:
    """A lab's own column may be called as one of ours is inside."""
    rows = [f"{k},{visit},{10 + k + 0.1 * visit},x,0.5" for k in range(6) for visit in (1, 2)]
    path = written(tmp_path / "r.csv", "\n".join(["Person,Session,value,own,Error", *rows]))
    (one,) = lf.cohort(path, out=tmp_path / "out").found.parameters
    assert (one.count, one.people, one.own) == (12, 6, 0.5)

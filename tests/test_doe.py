"""The design of experiments: statistics against planted truths, runs against each other."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, cast
from unittest.mock import Mock

import numpy as np
import pandas as pd
import pytest
from making_doe import TOML, SpringLeg, definition, options, planted_table
from mpi4py import MPI
from typer.testing import CliRunner

from legfem.curve import ForceCurve
from legfem.study.cli import app
from legfem.study.doe import command
from legfem.study.doe.anova import anova, coefficient_tests
from legfem.study.doe.command import run
from legfem.study.doe.definition import IDENTIFIED, PAPER, read_definition
from legfem.study.doe.design import factorial_design, space_filling_design
from legfem.study.doe.effects import lenth_of
from legfem.study.doe.factors import Factor
from legfem.study.doe.metrics import Metric, metrics_in
from legfem.study.doe.paper import TABLE_2, TABLE_3, check_table_3
from legfem.study.doe.simulator import PlaneStrainSimulator, Record, Request, failed
from legfem.study.doe.study import analyse
from legfem.study.doe.surface import NotEstimableError, fit_surface
from legfem.study.doe.verdict import Finding, _in_words

SLOPE = Metric("slope", 0.0, 5.0)
SHALLOW = """\
depth_mm = 2.0
windows_mm = [[0, 2]]
[factors."deep.C10"]
low_kPa = 1.0
high_kPa = 4.0
[factors."fascia.thickness"]
low_mm = 0.4
high_mm = 0.8
"""


# --- statistics ---


def test_planted_polynomial_is_recovered_and_agrees_with_statsmodels() -> None:
    given, table, truth = planted_table(noise=0.05)
    surface = fit_surface(table, given.factors, SLOPE)
    found, tests = anova(surface), coefficient_tests(surface)
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


def test_degrees_of_freedom_of_the_papers_text() -> None:
    given, table, _ = planted_table(noise=0.05)
    surface = fit_surface(table, given.factors, SLOPE)
    right, text = anova(surface), anova(surface, "factors")
    assert (text.model_dof, text.error_dof) == (4, 28)
    assert text.F == pytest.approx(right.F * (15 / 4) * (28 / 17))
    t = [coefficient_tests(surface, counting)[1].t for counting in ("factors", "coefficients")]
    assert t[0] == pytest.approx(t[1] * np.sqrt(28 / 17))


def test_printed_table_3_used_15_and_17_and_has_one_misprint() -> None:
    checks = {check.row.metric: check for check in check_table_3()}
    assert [row.metric for row in TABLE_3] == [
        metric.name for metric in metrics_in(((0, 5), (5, 20), (20, 30)))
    ]
    assert all(check.error_dof_fits and check.r_squared_fits for check in checks.values())
    assert [name for name, c in checks.items() if not c.model_dof_fits] == ["curvature_20_30"]
    # Neither does the text's p = 5 explain any row.
    for check in checks.values():
        assert not check.model_dof[0] <= 4 <= check.model_dof[1]
        assert not check.error_dof[0] <= 28 <= check.error_dof[1]
    assert float(checks["curvature_20_30"].row.ssr) / 15 == pytest.approx(1.2e-5)


def test_lenth_tells_active_effects_from_noise() -> None:
    given, table, _ = planted_table(noise=0.0)
    rng = np.random.default_rng(1)
    s = [f.symbol for f in given.factors]
    for metric in metrics_in(given.windows):
        table[metric.name] = 5 + 3 * table[s[1]] + table[s[1]] * table[s[2]] * table[s[3]]
        table[metric.name] += 0.05 * rng.standard_normal(33)
    done, not_done = analyse(given, table, "coefficients")
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
    (analysis, *_), _ = analyse(given, bent, "coefficients")
    assert analysis.centre is not None
    assert analysis.centre.difference == pytest.approx(2.0, abs=0.01)
    assert analysis.centre.p_value < 1e-6
    corners = fit_surface(bent[:32], given.factors, analysis.metric)
    share = 1 - corners.fit.ssr / analysis.surface.fit.ssr
    assert analysis.centre.share_of_sse == pytest.approx(share)
    assert analysis.residuals.shapiro < 0.01


def test_missing_runs_are_left_out_and_said() -> None:
    given, table, truth = planted_table(noise=1e-6)
    table.loc[2, "slope_20_30"] = np.nan
    done, _ = analyse(given, table, "coefficients")
    last = done[-1]
    assert last.surface.missing == (3,) and last.anova.error_dof == 16 and last.lenth is None
    assert last.tests[1].value == pytest.approx(truth[last.tests[1].term], abs=1e-4)
    assert all(a.anova.error_dof == 17 and a.lenth is not None for a in done[:-1])
    table.loc[table[given.factors[0].symbol] > 0, "slope_20_30"] = np.nan
    with pytest.raises(NotEstimableError, match=r"confounded|coefficients need more"):
        fit_surface(table, given.factors, done[-1].metric)
    done, not_done = analyse(given, table, "coefficients")
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
        ([None, None], "can't be told"),
    ],
)
def test_verdicts_in_words(findings: list[bool | None], words: str) -> None:
    assert _in_words(tuple(Finding(f, "", "") for f in findings), ["a", "b"]) == words


def test_a_verdict_names_its_condition() -> None:
    findings = (Finding(True, "", "", "fat is known"), Finding(True, "", "", "fat is known"))
    assert _in_words(findings, ["a", "b"]) == "holds only where fat is known"


# --- the design ---


def test_the_shipped_designs_are_the_papers_five_factors() -> None:
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
        ("low_mm = 0.2", 'low_mm = "thin"', "not a finite number"),
        ('"linear"', '"log"', "use 'linear' or 'logarithmic'"),
        ("[20, 30]", "[30, 20]", "no part of 0 to 30 mm"),
        ("title =", "title", "TOML"),
        ("depth_mm", "depth", "did you mean 'depth_mm'?"),
    ],
)
def test_what_cannot_be_used_is_said_in_a_line(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    assert old in TOML
    path, out = definition(tmp_path, TOML.replace(old, new, 1)), tmp_path / "out"
    ran = CliRunner().invoke(app, ["doe", "--factors", str(path), "--out", str(out)])
    assert ran.exit_code == 2
    assert ran.output.count("\n") == 1 and said in ran.output and str(path) in ran.output
    assert not out.exists()


def test_missing_definition(tmp_path: Path) -> None:
    ran = CliRunner().invoke(app, ["doe", "--factors", str(tmp_path / "none.toml")])
    assert ran.exit_code == 2 and ran.output.count("\n") == 1 and "not found" in ran.output


# --- runs ---


@pytest.fixture
def no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out what takes longest."""
    for name in ("response", "half_normal", "normality", "sobol", "information"):
        monkeypatch.setattr(command, f"draw_{name}", lambda *_: [])


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study with everything; its results."""
    folder = tmp_path_factory.mktemp("doe")
    run(options(folder), MPI.COMM_SELF, SpringLeg())
    return folder / "out"


def tables(folder: Path) -> tuple[str, dict]:
    document = json.loads((folder / "result.json").read_text())
    return (folder / "runs.csv").read_text(), {
        k: v for k, v in document.items() if k not in ("wall_s", "versions")
    }


def test_a_study_from_definition_to_files(whole: Path) -> None:
    out = whole
    runs = pd.read_csv(out / "runs.csv")
    assert len(runs) == 33 and runs["complete"].all()
    assert runs["deep_C10_kPa"].iloc[-1] == pytest.approx(15.25)
    last = runs.iloc[-1]
    slope = 1e-3 * (last["deep_C10_kPa"] + last["superficial_C10_kPa"] / 2) + 5e-3 * last[
        "deep_C20_kPa"
    ] * (1 + last["fascia_C10_MPa"] * last["fascia_thickness_mm"])
    assert last["slope_0_5_N_per_mm2"] == pytest.approx(slope)
    document = json.loads((out / "result.json").read_text())
    assert len(document["metrics"]) == 6 and document["failed_runs"] == []
    assert document["metrics"][0]["anova"]["error_dof"] == 17
    assert all(s["emulator_error"]["relative"] < 0.2 for s in document["sobol"])
    first = document["sobol"][0]["total"]
    assert first["deep.C10"] == pytest.approx(0, abs=0.01) and first["deep.C20"] > 0.3
    assert {p.name for p in out.iterdir()} == {
        "runs", "runs.csv", "result.json", "report.md", "response.png", "response.svg",
        "half-normal.png", "normality.png", "sobol.png", "information.png",
    }  # fmt: skip
    report = (out / "report.md").read_text()
    assert "33 of 33 runs reach 30 mm" in report and "Poisson's ratio is -0.14 to -0.98" in report


def test_information_of_a_leg_in_closed_form(whole: Path) -> None:
    found = json.loads((whole / "result.json").read_text())["information"]
    d = np.array(found["displacement_mm"])
    by = dict(zip(found["parameters"], found["sensitivity_N_per_log"], strict=True))
    assert np.allclose(by["deep.C10"], 50 * 15.25e-3 * d)
    bent = 50 * 15.25e-3 * 5.05 * 0.6 * d**2
    assert np.allclose(by["fascia.C10"], bent)
    assert np.allclose(by["fascia.thickness"], bent, rtol=0.02)
    # Fat and deep C10 do the same to this leg, as do the fascia's two.
    assert found["relative_sd_all_unknown"]["30 mm"][0] is None
    assert found["told_within_50_percent_from_mm"]["deep.C10"] is None


@pytest.mark.usefixtures("no_figures")
def test_two_definitions_share_runs_and_get_one_page_of_verdicts(tmp_path: Path) -> None:
    calls = tmp_path / "calls"
    calls.mkdir()
    other = tmp_path / "other.toml"
    given = options(tmp_path, definitions=(tmp_path / "design.toml", other))
    other.write_text(TOML)
    run(given, MPI.COMM_SELF, SpringLeg(calls))
    assert len(list(calls.iterdir())) == len(list((tmp_path / "out" / "runs").iterdir()))
    documents = json.loads((tmp_path / "out" / "result.json").read_text())
    assert {c["verdict"] for c in documents["claims"]} >= {"reproduced", "not reproduced"}
    page = (tmp_path / "out" / "verdict.md").read_text()
    assert "not reproduced" in page and page.count("1.2e-7 / ") == 4
    assert f"--factors {given.definitions[0]} --factors {other} --subject-dir" in page
    assert tables(tmp_path / "out" / "design") == tables(tmp_path / "out" / "other")


def test_failed_runs_are_values(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stops = (("deep.C10", 0.5e-3, 12.0), ("deep.C20", 0.5e-3, 12.0), ("fascia.C10", 10.0, 12.0),
             ("fascia.thickness", 0.2, 12.0), ("superficial.C10", 1e-3, 12.0))  # fmt: skip
    run(options(tmp_path, beyond=False), MPI.COMM_SELF, SpringLeg(stops=stops))
    document = json.loads((tmp_path / "out" / "result.json").read_text())
    (failed,) = document["failed_runs"]
    assert failed["reached_mm"] == 12.0
    dof = {m["metric"]: m["anova"]["error_dof"] for m in document["metrics"]}
    assert dof["slope_0_5"] == 17 and dof["slope_5_20"] == 16
    assert "1 of 33 runs stopped short" in capsys.readouterr().err
    report = (tmp_path / "out" / "report.md").read_text()
    assert "32 of 33 runs reach 30 mm" in report and f"Run {failed['run']} stops at 12.00" in report


@pytest.mark.parametrize("stopping", ["half", "all"])
def test_a_study_with_too_few_runs_says_so(tmp_path: Path, stopping: str) -> None:
    stops = (("fascia.C10", 10.0, 12.0),)
    given = options(tmp_path, beyond=False)
    if stopping == "all":
        path = definition(tmp_path, TOML + '\n[fixed]\n"deep.D1_per_MPa" = 28.0\n')
        stops = (("deep.D1", 28.0, 0.5),)
        assert path in given.definitions
    run(given, MPI.COMM_SELF, SpringLeg(stops=stops))
    document = json.loads((tmp_path / "out" / "result.json").read_text())
    assert len(document["not_analysed"]) == {"half": 4, "all": 6}[stopping]
    assert "isn't analysed" in (tmp_path / "out" / "report.md").read_text()


@pytest.mark.usefixtures("no_figures")
def test_interrupted_and_resumed_the_same(tmp_path: Path, whole: Path) -> None:
    calls = tmp_path / "calls"
    calls.mkdir()
    for killed_after in (5, 20, 40):
        with pytest.raises(KeyboardInterrupt):
            run(options(tmp_path), MPI.COMM_SELF, SpringLeg(calls, killed_after=killed_after))
        assert len(list((tmp_path / "out" / "runs").glob("*.json"))) == killed_after
        csv = pd.read_csv(tmp_path / "out" / "runs.csv")
        assert csv["complete"].sum() == min(killed_after, 33)
    run(options(tmp_path), MPI.COMM_SELF, SpringLeg(calls))
    assert tables(tmp_path / "out") == tables(whole)
    done = len(list((tmp_path / "out" / "runs").glob("*.json")))
    assert len(list(calls.iterdir())) == done


def test_an_interrupt_that_a_solve_swallows_is_no_failed_run() -> None:
    class Swallows:
        def solve(self, *_: Any, **__: Any) -> None:
            try:
                os.kill(os.getpid(), signal.SIGINT)
                time.sleep(1.0)
            except KeyboardInterrupt:
                raise RuntimeError("error code -1") from None

    section, indenter, tissues = Mock(fascia_thickness=0.6), Mock(radius=15.0), Mock()
    simulator = PlaneStrainSimulator(section, indenter, tissues)
    simulator._tests[0.6, 30.0, "default"] = cast(Any, Swallows())
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        simulator.simulate(Request("factorial", 0, (), 30.0))
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.usefixtures("no_figures")
def test_runs_that_gave_nothing_are_tried_again(tmp_path: Path) -> None:
    class Disk(SpringLeg):
        def simulate(self, request: Request, on_step: Any = None) -> Record:
            return failed("OSError: no space left on device")

    run(options(tmp_path, beyond=False), MPI.COMM_SELF, Disk())
    assert len(json.loads((tmp_path / "out" / "result.json").read_text())["failed_runs"]) == 33
    run(options(tmp_path, beyond=False), MPI.COMM_SELF, SpringLeg())
    assert not json.loads((tmp_path / "out" / "result.json").read_text())["failed_runs"]


@pytest.mark.usefixtures("no_figures")
def test_two_processes_give_the_same_table(tmp_path: Path) -> None:
    run(options(tmp_path, "one", beyond=False), MPI.COMM_SELF, SpringLeg())
    calls = tmp_path / "calls"
    calls.mkdir()
    run(options(tmp_path, "two", jobs=2, beyond=False), MPI.COMM_SELF, SpringLeg(calls))
    assert len(list(calls.iterdir())) == 33
    assert tables(tmp_path / "one") == tables(tmp_path / "two")


@pytest.mark.slow
@pytest.mark.mpi
def test_a_leg_gives_the_same_table_in_one_process_two_and_two_ranks(tmp_path: Path) -> None:
    path = definition(tmp_path, SHALLOW)
    ways = {"one": ([], 1), "two": ([], 2), "ranks": (["mpirun", "-n", "2"], 1)}
    for out, (before, jobs) in ways.items():
        subprocess.run(
            [*before, sys.executable, "-m", "legfem.study", "doe", "--factors", path, "--jobs",
             str(jobs), "--factorial-only", "--out", tmp_path / out],
            check=True, timeout=600,
        )  # fmt: skip
    assert pd.read_csv(tmp_path / "one" / "runs.csv")["complete"].sum() == 5
    assert tables(tmp_path / "one") == tables(tmp_path / "two") == tables(tmp_path / "ranks")


@pytest.mark.mpi
def test_two_ranks_give_the_same_table(tmp_path: Path, whole: Path) -> None:
    options(tmp_path)
    calls = tmp_path / "calls"
    calls.mkdir()
    tests = Path(__file__).parent
    subprocess.run(
        ["mpirun", "-n", "2", sys.executable, tests / "making_doe.py", tmp_path, "ranks"],
        check=True, timeout=300,
    )  # fmt: skip
    ranks = [path.name.rpartition("-")[2] for path in calls.iterdir()]
    assert ranks.count("1") > 30 and ranks.count("0") > 30
    assert tables(tmp_path / "ranks") == tables(whole)

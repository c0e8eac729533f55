"""The design of experiments: runs against each other, and what they leave."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pandas as pd
import pytest
from making_doe import TOML, SpringLeg, definition, fewer_samples, options
from making_ranks import environment
from mpi4py import MPI
from typer.testing import CliRunner

from legfem.commands.study import app
from legfem.inverse.outcome import Outcome
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store
from legfem.solve.path import ForceCurve
from legfem.study.doe import command
from legfem.study.doe.command import run
from legfem.study.doe.runs import Outlook, PlaneStrainSimulator, Request
from studies.frauziols import claims

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


@pytest.fixture
def no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out what takes longest."""
    monkeypatch.setattr(command, "draw_response", lambda *_: [])


@pytest.fixture(scope="module", autouse=True)
def few_samples() -> Iterator[None]:
    """Fewer samples of the emulator: its indices are looked at in test_doe."""
    with fewer_samples():
        yield


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study with everything; its results."""
    folder = tmp_path_factory.mktemp("doe")
    run(options(folder), MPI.COMM_SELF, SpringLeg())
    return folder / "out"


def tables(folder: Path) -> tuple[str, dict]:
    document = json.loads((folder / "result.json").read_text())
    return (folder / "runs.csv").read_text(), {k: v for k, v in document.items() if k not in ("wall_s", "versions")}


def said_in(out: Path) -> str:
    """Return a study's report, its lines joined."""
    return " ".join((out / "report.txt").read_text().split())


def test_a_study_from_definition_to_files(whole: Path) -> None:
    out = whole
    runs = pd.read_csv(out / "runs.csv")
    assert len(runs) == 33 and runs["complete"].all()
    assert runs["deep_C10_kPa"].iloc[-1] == pytest.approx(15.25)
    last = runs.iloc[-1]
    slope = 1e-3 * (last["deep_C10_kPa"] + last["superficial_C10_kPa"] / 2) + 5e-3 * last["deep_C20_kPa"] * (
        1 + last["fascia_C10_MPa"] * last["fascia_thickness_mm"]
    )
    assert last["slope_0_5_N_per_mm2"] == pytest.approx(slope)
    document = json.loads((out / "result.json").read_text())
    assert len(document["metrics"]) == 6 and document["failed_runs"] == []
    assert document["metrics"][0]["anova"]["error_dof"] == 17
    assert all(s["emulator_error"]["relative"] < 0.2 for s in document["sobol"])
    first = document["sobol"][0]["total"]
    assert first["deep.C10"] == pytest.approx(0, abs=0.01) and first["deep.C20"] > 0.3
    assert {p.name for p in out.iterdir()} == {
        "runs",
        "runs.csv",
        "result.json",
        "report.txt",
        "report.md",
        "report.html",
        "numbers.csv",
        "numbers.xlsx",
        "response.png",
        "response.svg",
        "ro-crate-metadata.json",
    }
    report = said_in(out)
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
    results = run(given, MPI.COMM_SELF, SpringLeg(calls))
    assert len(list(calls.iterdir())) == len(list((tmp_path / "out" / "runs").iterdir()))
    documents = json.loads((tmp_path / "out" / "result.json").read_text())
    assert [one["study"] for one in documents["studies"]] == ["doe", "doe"]
    found = claims.verdicts(results)
    assert {one.verdict for one in found} >= {"reproduced", "not reproduced"}
    page = claims.claims_page(results, found, "python -m studies.frauziols claims --seed 1")
    assert "not reproduced" in page and page.count("1.2e-7 / ") == 4
    assert "python -m studies.frauziols claims --seed 1" in page
    assert tables(tmp_path / "out" / "design") == tables(tmp_path / "out" / "other")


@pytest.mark.usefixtures("no_figures")
def test_failed_runs_are_values(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stops = (
        ("deep.C10", 0.5e-3, 12.0),
        ("deep.C20", 0.5e-3, 12.0),
        ("fascia.C10", 10.0, 12.0),
        ("fascia.thickness", 0.2, 12.0),
        ("superficial.C10", 1e-3, 12.0),
    )
    run(options(tmp_path, beyond=False), MPI.COMM_SELF, SpringLeg(stops=stops))
    document = json.loads((tmp_path / "out" / "result.json").read_text())
    (failed,) = document["failed_runs"]
    assert failed["reached_mm"] == 12.0
    dof = {m["metric"]: m["anova"]["error_dof"] for m in document["metrics"]}
    assert dof["slope_0_5"] == 17 and dof["slope_5_20"] == 16
    assert "1 of 33 runs stopped short" in capsys.readouterr().err
    report = said_in(tmp_path / "out")
    assert "32 of 33 runs reach 30 mm" in report and f"Run {failed['run']} stops at 12.00" in report


def test_the_command_fails_where_nothing_was_solved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for solved, status in ((False, 1), (True, 0)):
        titled = SimpleNamespace(title="a study")
        result = SimpleNamespace(outcomes=[0], failed=[] if solved else [0], definition=titled, analyses=[])
        monkeypatch.setattr(command, "run", lambda *_, result=result: [result])
        done = CliRunner().invoke(app, ["doe", "--out", str(tmp_path / "out")])
        assert done.exit_code == status
        assert ("nothing was solved" in done.output) is not solved


@pytest.mark.parametrize("stopping", ["half", "all"])
def test_a_study_with_too_few_runs_says_so(tmp_path: Path, stopping: str) -> None:
    stops = (("fascia.C10", 10.0, 12.0),)
    given = options(tmp_path, beyond=False)
    if stopping == "all":
        path = definition(tmp_path, TOML + '\n[fixed]\n"deep.D1_per_MPa" = 28.0\n')
        stops = (("deep.D1", 28.0, 0.5),)
        assert path in given.definitions
    (result,) = run(given, MPI.COMM_SELF, SpringLeg(stops=stops))
    assert (len(result.failed) < len(result.outcomes)) is (stopping == "half")
    document = json.loads((tmp_path / "out" / "result.json").read_text())
    assert len(document["not_analysed"]) == {"half": 4, "all": 6}[stopping]
    assert "isn't analysed" in said_in(tmp_path / "out")


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


def test_an_interrupt_that_a_solve_swallows_is_no_failed_run(monkeypatch: pytest.MonkeyPatch) -> None:
    class Swallows:
        def solve(self, *_: Any, **__: Any) -> None:
            try:
                os.kill(os.getpid(), signal.SIGINT)
                time.sleep(1.0)
            except KeyboardInterrupt:
                raise RuntimeError("error code -1") from None

    section, indenter, tissues = Mock(fascia_thickness=0.6), Mock(radius=15.0), Mock()
    simulator = PlaneStrainSimulator(section, indenter, tissues)
    monkeypatch.setattr(simulator, "_test", lambda *_: Swallows())
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        list(Workers(PlaneStrainSimulator.solve, simulator).run([Request("factorial", 0, (), 30.0)]))
    assert signal.getsignal(signal.SIGINT) is before


def test_kept_runs_come_back_to_the_last_bit(tmp_path: Path) -> None:
    numbers = np.random.default_rng(0).random((3, 20))
    request = Request("factorial", 0, (("deep.C10", 0.1 + 0.2),), 30.0)
    curve = ForceCurve(numbers[0], numbers[1], {"deep.C10": numbers[2]})
    store = Store(tmp_path, Outcome, {"leg": 1})
    store.put(request.asked, Outcome({"deep.C10": 0.1 + 0.2}, (curve,), True, "", 0, 0.0))
    found = store.get(request.asked)
    assert found is not None and np.array_equal(found.curve.displacement, numbers[0])
    assert np.array_equal(found.curve.force, numbers[1])
    assert np.array_equal(found.curve.sensitivities["deep.C10"], numbers[2])
    assert store.get(replace(request, stage="nominal", number=3).asked) is not None
    for other in ({"depth": 29.0}, {"fidelity": "refined"}, {"sensitivities": ("deep.C10",)}):
        assert store.get(replace(request, **other).asked) is None
    assert Store(tmp_path, Outcome, {"leg": 2}).get(request.asked) is None
    (path,) = tmp_path.iterdir()
    path.write_text(path.read_text()[:-40])
    assert store.get(request.asked) is None


@pytest.mark.usefixtures("no_figures")
def test_runs_that_gave_nothing_are_tried_again(tmp_path: Path) -> None:
    class Disk(SpringLeg):
        def solve(self, request: Request) -> Outcome:
            return Outcome(dict(request.values), (), False, "OSError: no space left on device", 0, 0.0)

    run(options(tmp_path, beyond=False), MPI.COMM_SELF, Disk())
    assert len(json.loads((tmp_path / "out" / "result.json").read_text())["failed_runs"]) == 33
    run(options(tmp_path, beyond=False), MPI.COMM_SELF, SpringLeg())
    assert not json.loads((tmp_path / "out" / "result.json").read_text())["failed_runs"]


@pytest.mark.slow
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
            [
                *before,
                sys.executable,
                "-m",
                "legfem.study",
                "doe",
                "--factors",
                path,
                "--jobs",
                str(jobs),
                "--factorial-only",
                "--out",
                tmp_path / out,
            ],
            check=True,
            timeout=600,
        )
    assert pd.read_csv(tmp_path / "one" / "runs.csv")["complete"].sum() == 5
    assert tables(tmp_path / "one") == tables(tmp_path / "two") == tables(tmp_path / "ranks")


def on_two_ranks(home: Path) -> list[list[str]]:
    """Run a study on two ranks, into the folder ``ranks``; return each run's stage, number, process and rank."""
    options(home)
    calls = home / "calls"
    calls.mkdir()
    script = Path(__file__).parent / "making_doe.py"
    subprocess.run(
        ["mpirun", "-n", "2", sys.executable, script, home, "ranks"], env=environment(), check=True, timeout=300
    )
    return [path.name.rsplit("-", 3) for path in calls.iterdir()]


@pytest.mark.slow
@pytest.mark.mpi
def test_two_ranks_give_the_same_study(tmp_path: Path, whole: Path) -> None:
    done = on_two_ranks(tmp_path)
    assert {rank for *_, rank in done} == {"0", "1"}
    assert len({(stage, number) for stage, number, *_ in done}) == len(done) > 60, "nothing is done twice"
    assert tables(tmp_path / "ranks") == tables(whole)


def test_each_stage_says_how_long_the_whole_study_will_take():
    outlook = Outlook(ahead=70)
    assert outlook.begin(33) == ", of 70 simulations in all"
    outlook.done, outlook.seconds = 30, 60.0
    assert outlook.begin(3) == "; about 74 s left in all"
    assert outlook.ahead == 34
    assert Outlook(ahead=33).begin(33) == "", "the only stage shows its own time left"

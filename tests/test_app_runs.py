"""The app's runs: commands as processes that outlive it, and what their results come to."""

import csv
import fcntl
import io
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import openpyxl
import pytest
from making import write_subject
from making_diagnosed import diagnosed
from making_results import result
from test_diagnosis_report import CASES
from typer.main import get_command

from legfem.app.outcomes import RunResult, answers_of, as_csv, as_xlsx, relative_difference, sentence_of
from legfem.app.runs import ACTIONS, Run, RunState, rename_input
from legfem.common.documents import write_document
from legfem.common.errors import InputError
from legfem.common.numbers import number
from legfem.common.progress import Lines, Reached, reached
from legfem.inverse.document import fit_document
from legfem.inverse.fit import Computed
from legfem.legs.loading import load_subject
from legfem.report.diagnosis import diagnosis_web_page
from legfem.report.diagnosis_document import document


@pytest.fixture
def module(tmp_path, monkeypatch):
    """Return a function that makes a module, which a run then runs."""
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")

    def make(text):
        (tmp_path / "pretended.py").write_text(text)
        return "pretended"

    return make


def ended(run, seconds=30.0):
    end = time.monotonic() + seconds
    while run.alive:
        assert time.monotonic() < end, run.log()
        time.sleep(0.02)
    return run.state


def said(run, text, seconds=30.0):
    end = time.monotonic() + seconds
    while not any(text in line for line in run.log()):
        assert time.monotonic() < end, run.log()
        time.sleep(0.02)


GOES_ON = """
import pathlib, sys, time
kept = pathlib.Path(sys.argv[1])
print("kept" if kept.exists() else "anew", file=sys.stderr, flush=True)
if not kept.exists():
    kept.touch()
    print("[   1.0 s] solving", file=sys.stderr, flush=True)
    try:
        time.sleep(60)
    except KeyboardInterrupt:
        print("interrupted: run the same command again to go on", file=sys.stderr)
        sys.exit(130)
print("result")
"""


def test_a_run_is_stopped_by_ctrl_c_and_goes_on_where_it_was(workspace, module, tmp_path):
    folder = workspace.run(workspace.new_run("identify-leg"))
    run = Run.begun(folder, module(GOES_ON), [str(tmp_path / "kept")], "leg")
    said(run, "solving")
    assert run.state is RunState.RUNNING and not run.resume()
    assert run.reached().stage == "solving"
    assert run.cancel()
    assert ended(run) is RunState.STOPPED
    # Another server, which knows the folder alone.
    again = Run(folder)
    assert not again.cancel() and again.resume()
    assert ended(again) is RunState.DONE
    assert (folder / "out.txt").read_text() == "result\n"
    stopped = "interrupted: run the same command again to go on"
    assert again.log() == ["anew", "[   1.0 s] solving", stopped, "kept"]
    assert again.reached() is None, "progress before the stop isn't this start's"
    assert again.command == f"python -m pretended {tmp_path / 'kept'}"
    assert again.asked.about == "leg"


def test_a_run_outlives_the_server_that_began_it(workspace, module, tmp_path):
    folder = workspace.run(workspace.new_run("identify-leg"))
    name = module(
        "import sys; print('on', file=sys.stderr, flush=True); sys.stdin.read()\nimport time; time.sleep(0.5)"
    )
    script = (
        "import os, signal, sys, pathlib; from legfem.app.runs import Run\n"
        f"Run.begun(pathlib.Path({str(folder)!r}), {name!r}, [], 'leg')\n"
        "os.kill(os.getpid(), signal.SIGKILL)"
    )
    server = subprocess.run([sys.executable, "-c", script], check=False)
    assert server.returncode == -signal.SIGKILL
    run = Run(folder)
    said(run, "on")
    assert ended(run) is RunState.DONE


def test_a_run_that_is_killed_is_seen_to_be_and_can_be_begun_again(workspace, module, tmp_path):
    folder = workspace.run(workspace.new_run("identify-leg"))
    run = Run.begun(folder, module(GOES_ON), [str(tmp_path / "kept")], "leg")
    said(run, "solving")
    assert run.cancel(at_once=True)
    assert ended(run) is RunState.LOST
    assert run.resume() and ended(run) is RunState.DONE


def test_a_run_can_be_ended_from_its_first_moment_on(workspace, module, tmp_path):
    folder = workspace.run(workspace.new_run("identify-leg"))
    run = Run.begun(folder, module(GOES_ON), [str(tmp_path / "kept")], "leg")
    assert run.cancel(at_once=True)
    assert ended(run) is RunState.LOST


def test_what_was_deleted_last_stands_first(workspace):
    for name in ("first", "second"):
        workspace.new_input(name)
    for name in ("second", "first"):
        workspace.delete("inputs", name)
        time.sleep(0.02)
    assert workspace.deleted == [("inputs", "first"), ("inputs", "second")]


@pytest.mark.parametrize(("status", "state"), [(0, RunState.DONE), (1, RunState.FAILED), (2, RunState.REFUSED)])
def test_how_a_run_ended_is_what_its_exit_status_says(workspace, module, status, state):
    folder = workspace.run(workspace.new_run("identify-leg"))
    run = Run.begun(folder, module(f"raise SystemExit({status})"), [], "leg")
    assert ended(run) is state


def test_progress_is_read_as_it_was_written(capsys):
    lines = Lines(sys.stdout)
    lines.stage("meshing")
    lines.stage("solving", 3)
    lines.advance("C10 0.5 kPa, 2/3 done")
    printed = capsys.readouterr().out.splitlines()
    about_now = pytest.approx(0, abs=1)
    assert reached(["warning: x", *printed[:1]]) == Reached(about_now, "meshing", began=about_now)
    last = reached(printed)
    assert (last.stage, last.done, last.total) == ("solving", 1, 3)
    assert last.last == "C10 0.5 kPa, 2/3 done"
    lines.stage("searching")
    lines.advance("one")
    last = reached(capsys.readouterr().out.splitlines())
    assert (last.stage, last.done, last.total, last.last) == ("searching", 1, None, "one")
    assert reached(["no line of progress"]) is None
    read = reached(["[  10.0 s] solving", "[  40.0 s]   3/9  one"])
    assert read.left == pytest.approx(60.0)


def test_every_commands_options_are_those_that_it_takes():
    for actions in ACTIONS.values():
        for action in actions:
            command = get_command(import_module(action.module.replace("legfem.", "legfem.commands.")).app)
            known = {name for one in command.params for name in one.opts}
            assert {action.folder, "--out", *(one.option for one in action.choices)} <= known


def test_typed_options_are_taken_apart_without_a_shell():
    action = ACTIONS["subject.toml"][0]
    folder, out = Path("/leg"), Path("/out")
    found = action.options(folder, out, {"--law": "both", "--depth": ""}, "--prior 'deep.C10=2±1'")
    assert found == ["--subject-dir", "/leg", "--out", "/out", "--law", "both", "--prior", "deep.C10=2±1"]
    assert action.options(folder, out, {}, "; rm -rf $HOME")[4:] == [";", "rm", "-rf", "$HOME"]
    for bad in ("--out=/x", "--subject 3", "'open"):
        with pytest.raises(InputError):
            action.options(folder, out, {}, bad)


def pretended(workspace, kind):
    folder = workspace.run(workspace.new_run(f"{kind}-leg"))
    (folder / "run.json").write_text(
        json.dumps({"about": "leg", "arguments": ["python", "-m", f"legfem.{kind}"], "cwd": "/", "began": 0})
    )
    (folder / "results").mkdir()
    return Run(folder)


def test_both_laws_of_an_identification_are_compared(workspace):
    run, both = (pretended(workspace, "identify"), [result("neo-hookean"), result("reduced-polynomial")])
    (run.results / "result.json").write_text('[{"half')
    (row,) = answers_of(run)
    assert (row.kind, row.state, row.verdict) == ("identify", RunState.LOST, "")
    write_document(run.results / "result.json", fit_document(both))
    for row, one in zip(answers_of(run), both, strict=True):
        shown = one.estimates["deep.C10"].shown
        low, high = shown.ci95
        digits = [number(value, (high - low) / 4) for value in (shown.value, low, high)]
        assert row.shown("c10_deep") == "{} kPa ({} to {})".format(*digits)
        assert bool(row.shown("c20_deep")) == ("deep.C20" in one.estimates)
        each = [f"{symbol} of the muscle identifiable" for symbol in ("C10", "C20")[: len(one.estimates)]]
        assert (row.law, row.verdict) == (one.law, ", ".join(each))


@pytest.mark.parametrize(("status", "next_state"), [(0, RunState.DONE), (3, RunState.WAITING)])
def test_a_run_is_followed_by_the_next_if_it_is_done(module, tmp_path, status, next_state):
    first, second = tmp_path / "first", tmp_path / "second"
    for folder in (first, second):
        folder.mkdir()
    following = Run.written(second, module(f"raise SystemExit({status})"), [], "leg", waits=True)
    assert following.state is RunState.WAITING
    run = Run.begun(first, "pretended", [], "leg", then="second")
    ended(run)
    if status == 0:
        end = time.monotonic() + 30.0
        while not (second / "exit.json").is_file():
            assert time.monotonic() < end
            time.sleep(0.02)
        ended(following)
    assert following.state is next_state


def test_a_diagnosis_is_compared_by_its_verdict_and_what_it_makes_of_c10(workspace, tmp_path):
    effects, bump, asked = CASES["named"]
    found, run = diagnosed(effects, bump=bump, asked=asked), pretended(workspace, "diagnose")
    subject = load_subject(write_subject(tmp_path))
    write_document(run.results / "diagnosis.json", document(found, subject, 1.0))
    (row,) = answers_of(run)
    low, high = found.shown_interval("deep.C10")
    ends = [number(end, (high - low) / 4) for end in (low, high)]
    assert f" kPa ({ends[0]} to {ends[1]})" in row.shown("c10_deep")
    assert row.verdict == f"named: {found.models[0].names[0]}"
    page = diagnosis_web_page(found, subject, ())
    assert sentence_of(run) == f"{page.headline.heading.rstrip('.')}. {page.headline.sentence}"
    assert sentence_of(pretended(workspace, "identify")) == ""


def test_what_was_computed_with_a_fit_stands_beside_its_parameters(workspace):
    run = pretended(workspace, "stocking")
    pressure = Computed(21.3, 0.5, (20.3, 22.3), "mmHg", "mean pressure on the skin")
    fit = replace(result("neo-hookean"), computed={"pressure_on_skin": pressure})
    write_document(run.results / "result.json", fit_document([fit]))
    (row,) = answers_of(run)
    assert row.verdict == f"C10 of the muscle {fit.identifiability}, mean pressure on the skin 21 mmHg"
    rows = list(csv.DictReader(io.StringIO(as_csv([row]).decode("utf-8-sig"))))
    assert [one["parameter"] for one in rows] == ["c10_deep", "pressure_on_skin"]
    assert [rows[1][key] for key in ("value", "low", "high", "unit")] == ["21.3", "20.3", "22.3", "mmHg"]


def test_all_numbers_of_all_runs_are_a_table_for_other_programs(workspace):
    run, both = pretended(workspace, "identify"), [result("neo-hookean"), result("reduced-polynomial")]
    write_document(run.results / "result.json", fit_document(both))
    rows = list(csv.DictReader(io.StringIO(as_csv(answers_of(run)).decode("utf-8-sig"))))
    assert [(row["law"], row["parameter"]) for row in rows] == [
        ("neo-hookean", "c10_deep"),
        ("reduced-polynomial", "c10_deep"),
        ("reduced-polynomial", "c20_deep"),
    ]
    shown = both[1].estimates["deep.C20"].shown
    found = [float(rows[2][key]) for key in ("value", "low", "high")]
    assert found == [shown.value, *shown.ci95] and rows[2]["unit"] == "kPa"
    sheet = openpyxl.load_workbook(io.BytesIO(as_xlsx(answers_of(run)))).active
    assert [[str(cell) for cell in row] for row in sheet.iter_rows(min_row=2, max_col=8, values_only=True)] == [
        list(row.values())[:8] for row in rows
    ]


@pytest.mark.parametrize("name", ["=1+1", "+A1", "-1+A1", "@SUM(A1)"])
def test_a_name_that_would_be_a_formula_is_none_in_a_spreadsheet(name):
    text = as_csv([RunResult("run", name, "identify", "done")]).decode("utf-8-sig")
    _, row = csv.reader(io.StringIO(text))
    assert row[1] == f"'{name}"


def test_a_renamed_input_keeps_its_runs_and_what_is_deleted_can_be_put_back(workspace):
    name = workspace.new_input("leg")
    run = workspace.run(workspace.new_run("identify-leg"))
    arguments = ["python", "-m", "legfem.identify", "--subject-dir", str(workspace.input(name))]
    write_document(run / "run.json", {"about": name, "arguments": arguments, "cwd": "/", "began": 0.0})
    now = rename_input(workspace, name, "left calf")
    assert now == "left calf" and workspace.inputs == ["left calf"]
    assert Run(run).asked.about == "left calf" and str(workspace.input(now)) in Run(run).command.replace("'", "")
    workspace.delete("inputs", now)
    assert not workspace.inputs and workspace.deleted == [("inputs", "left calf")]
    workspace.new_input("left calf")
    assert workspace.put_back("inputs", "left calf") == "left calf-2" and not workspace.deleted
    (run / "lock").touch()
    with (run / "lock").open("rb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with pytest.raises(InputError, match="runs on it; stop that first"):
            rename_input(workspace, now, "right calf")


def test_a_difference_has_the_interval_of_both_errors():
    # Both are known to a factor of two: their ratio to one of 2 to the power of the root of two.
    assert relative_difference((2.0, 1.0, 4.0), (1.0, 0.5, 2.0)) == "+100 % (-25 to +433 %)"
    assert relative_difference((2.0, 1.0, 4.0), (2.0, 1.0, 4.0)) == "–"
    assert relative_difference((1.0, 0.0, 4.0), (2.0, 1.0, 4.0)) == "-50 %"

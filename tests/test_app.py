"""The app without a browser: the workspace, runs as processes, the guard, the file's form."""

import asyncio
import json
import os
import signal
import socket
import subprocess
import sys
import time
import tomllib
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from making import write_subject
from making_diagnosed import diagnosed
from making_results import result
from making_specimens import write_bars
from starlette.requests import ClientDisconnect
from starlette.responses import PlainTextResponse
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect
from test_diagnosis_report import CASES
from typer.main import get_command

from legfem.app.__main__ import app
from legfem.app.actions import ACTIONS
from legfem.app.describe import (
    DressedLeg,
    LabSpecimens,
    PressedLeg,
    contours_in,
    known_tests,
    scans_in,
)
from legfem.app.guard import Guard
from legfem.app.outcomes import found_by, sentence_of
from legfem.app.runs import Run, RunState
from legfem.app.server import application
from legfem.app.settings import read_value, settings_of, with_channels, with_settings
from legfem.app.workspace import Workspace, plain_name
from legfem.common.documents import write_document
from legfem.common.errors import InputError
from legfem.common.progress import Lines, Reached, reached
from legfem.diagnose.document import document
from legfem.identify.document import result_document
from legfem.mechanics.materials import ReducedPolynomial
from legfem.recording.columns import Channel, Channels
from legfem.specimens.folder import load_specimen
from legfem.specimens.schema import SpecimenFile, parse_specimen_file
from legfem.stocking.leg_file import LegFile, parse_leg_file
from legfem.subjects.catalogue import RESOURCES
from legfem.subjects.schema import SubjectFile, parse_subject_file
from legfem.subjects.subject import load_subject

SUBJECT = RESOURCES / "frauziols" / "subjects" / "3"
PORT = 8765
HOST = {"host": f"127.0.0.1:{PORT}"}


@pytest.fixture
def workspace(tmp_path):
    return Workspace.opened(tmp_path / "workspace")


async def pieces(*parts):
    for part in parts:
        if isinstance(part, Exception):
            raise part
        yield part


def received(workspace, name, path, *parts):
    return asyncio.run(workspace.receive(name, path, pieces(*parts)))


# --- the workspace ---


@pytest.mark.parametrize(
    "name", ["", ".", "..", "../x", "a/b", "a\\b", ".bashrc", "a\0", "-rf", "~", "C:x", "x" * 300]
)
def test_names_that_could_lead_out_of_a_folder_are_refused(name):
    with pytest.raises(InputError, match="no plain name"):
        plain_name(name)


@pytest.mark.parametrize("path", ["../../evil", "a/../../evil", "/etc/x", "a//b", "a/b/c/d/e"])
def test_an_upload_stays_in_its_folder(workspace, path):
    name = workspace.new_input("leg")
    with pytest.raises(InputError):
        received(workspace, name, path, b"x")
    assert list(workspace.input(name).iterdir()) == []


def test_an_upload_is_there_whole_or_not_at_all(workspace):
    name = workspace.new_input("leg")
    target = received(workspace, name, "recordings/trial (1).csv", b"a" * 70_000, b"b")
    assert target.read_bytes() == b"a" * 70_000 + b"b"
    with pytest.raises(ClientDisconnect):
        received(workspace, name, "recordings/other.csv", b"half", ClientDisconnect())
    assert [path.name for path in target.parent.iterdir()] == ["trial (1).csv"]


def test_two_folders_of_one_name_are_two_inputs(workspace):
    assert [workspace.new_input("leg") for _ in range(3)] == ["leg", "leg-2", "leg-3"]
    assert workspace.new_input("../../évil/<b>") == "évil--b"
    assert workspace.free_run("identify-leg") == workspace.new_run("identify-leg")


def test_the_token_outlives_the_server_and_is_for_the_user_alone(workspace):
    token = workspace.token()
    assert Workspace.opened(workspace.folder).token() == token and len(token) >= 32
    assert (workspace.folder / "token").stat().st_mode & 0o077 == 0
    assert workspace.folder.stat().st_mode & 0o077 == 0


def test_a_changed_input_is_looked_at_anew(workspace):
    name = workspace.copied(SUBJECT, "leg")
    before = workspace.preview(name)
    assert workspace.preview(name) == before
    toml = workspace.input(name) / "subject.toml"
    toml.write_text(toml.read_text() + "\n")
    assert workspace.preview(name) != before


# --- runs ---


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
    assert again.about == "leg"


def test_a_run_outlives_the_server_that_began_it(workspace, module, tmp_path):
    folder = workspace.run(workspace.new_run("identify-leg"))
    name = module("import sys; print('on', file=sys.stderr, flush=True); sys.stdin.read()\n"
                  "import time; time.sleep(0.5)")  # fmt: skip
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
    said(run, "anew")
    assert run.cancel(at_once=True)
    assert ended(run) is RunState.LOST
    assert run.resume() and ended(run) is RunState.DONE


@pytest.mark.parametrize(
    ("status", "state"), [(0, RunState.DONE), (1, RunState.FAILED), (2, RunState.REFUSED)]
)
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
            command = get_command(import_module(f"{action.module}.__main__").app)
            known = {name for one in command.params for name in one.opts}
            assert {action.folder, "--out", *(one.option for one in action.choices)} <= known


def test_typed_options_are_taken_apart_without_a_shell():
    action = ACTIONS["subject.toml"][0]
    folder, out = Path("/leg"), Path("/out")
    found = action.options(folder, out, {"--law": "both", "--depth": ""}, "--prior 'deep.C10=2±1'")
    assert found == ["--subject-dir", "/leg", "--out", "/out", "--law", "both", "--prior",
                     "deep.C10=2±1"]  # fmt: skip
    assert action.options(folder, out, {}, "; rm -rf $HOME")[4:] == [";", "rm", "-rf", "$HOME"]
    for bad in ("--out=/x", "--subject 3", "'open"):
        with pytest.raises(InputError):
            action.options(folder, out, {}, bad)


# --- results ---


def pretended(workspace, kind):
    folder = workspace.run(workspace.new_run(f"{kind}-leg"))
    (folder / "run.json").write_text(json.dumps(
        {"about": "leg", "arguments": ["python", "-m", f"legfem.{kind}"], "cwd": "/", "began": 0}
    ))  # fmt: skip
    (folder / "results").mkdir()
    return Run(folder)


def test_both_laws_of_an_identification_are_compared(workspace):
    run, both = (
        pretended(workspace, "identify"),
        [result("neo-hookean"), result("reduced-polynomial")],
    )
    (run.results / "result.json").write_text('[{"half')
    (row,) = found_by(run)
    assert (row.kind, row.state, row.verdict) == ("identify", RunState.LOST, "")
    write_document(run.results / "result.json", [result_document(one) for one in both])
    for row, one in zip(found_by(run), both, strict=True):
        shown = one.parameters["deep.C10"].shown
        low, high = shown.ci95
        assert row.c10 == f"{shown.value:.3g} ({low:.3g} to {high:.3g}) kPa"
        assert bool(row.c20) == ("deep.C20" in one.parameters)
        assert (row.law, row.verdict) == (one.law, one.identifiability[0])


def test_a_diagnosis_is_compared_by_its_verdict_and_what_it_makes_of_c10(workspace, tmp_path):
    effects, bump, asked = CASES["named"]
    found, run = diagnosed(effects, bump=bump, asked=asked), pretended(workspace, "diagnose")
    subject = load_subject(write_subject(tmp_path))
    write_document(run.results / "diagnosis.json", document(found, subject, 0, 1.0))
    (row,) = found_by(run)
    low, high = found.intervals["C10"]
    assert f"({low:.3g} to {high:.3g}) kPa" in row.c10
    assert row.verdict == f"named: {found.models[0].names[0]}"
    assert sentence_of(run).endswith(row.verdict)


# --- the form ---


def test_a_form_changes_its_keys_and_leaves_the_files_comments(tmp_path):
    path = tmp_path / "subject.toml"
    text = (SUBJECT / "subject.toml").read_text()
    changed = with_settings(text, {("accuracy", "aim_sd_mm"): 1.5, ("section", "contours"): "a.csv",
                                   ("instrument", "force_range_N"): None})  # fmt: skip
    given, now = tomllib.loads(text), tomllib.loads(changed)
    assert now.pop("accuracy") == {"aim_sd_mm": 1.5}
    assert now["section"].pop("contours") == "a.csv"
    del given["section"]["contours"], given["instrument"]["force_range_N"]
    assert now == given
    assert changed.count("#") == text.count("#")
    path.write_text(with_settings(text, {("accuracy", "aim_sd_mm"): 1.5}))
    assert parse_subject_file(path).accuracy.aim_sd_mm == 1.5


@pytest.mark.parametrize("schema", [SubjectFile, LegFile])
def test_the_form_has_every_number_of_the_schema(schema):
    names = {one.name for one in settings_of(schema, "")}
    if schema is SubjectFile:
        assert {"indenter.aim_mm", "tissues.fascia.D1_per_MPa", "instrument.force_sd_N"} <= names
    else:
        assert {"stocking.stiffness_N_per_mm", "tissues.deep.C10_kPa", "bare.scan"} <= names
    needed = {one.name for one in settings_of(SubjectFile, "") if one.needed}
    assert "indenter.diameter_mm" in needed and "accuracy.aim_sd_mm" not in needed


def test_what_is_typed_is_read_as_the_key_wants_it():
    known = {one.name: one for one in settings_of(SubjectFile, "")}
    assert read_value(known["indenter.aim_mm"], "1, -2.5") == [1.0, -2.5]
    assert read_value(known["indenter.diameter_mm"], " 30 ") == 30.0
    assert read_value(known["title"], "") is None
    for text in ("3O", "1,5", "nan"):
        with pytest.raises(InputError, match="no number"):
            read_value(known["indenter.diameter_mm"], text)


def test_chosen_columns_are_what_the_folder_then_reads_by(tmp_path):
    channels = Channels(Channel("Zeit", "s"), Channel("Weg", "mm", -1), Channel("Kraft", "N", -1))
    path = tmp_path / "subject.toml"
    text = (SUBJECT / "subject.toml").read_text()
    path.write_text(with_channels(text, channels))
    assert parse_subject_file(path).recordings.channels() == channels
    assert parse_subject_file(path).recordings.starts_at_contact
    path.write_text(with_channels(path.read_text(), None))
    assert parse_subject_file(path) == parse_subject_file(SUBJECT / "subject.toml")


# --- loose files ---


def test_loose_files_become_a_leg_that_lacks_nothing_but_the_instrument(tmp_path):
    folder = tmp_path / "my leg"
    folder.mkdir()
    (folder / "outline.csv").write_bytes((SUBJECT / "contours.csv").read_bytes())
    for trial in (SUBJECT / "recordings").iterdir():
        (folder / trial.name).write_bytes(trial.read_bytes())
    assert contours_in(folder) == ["outline.csv"]
    PressedLeg("Mine", "outline.csv", 30, 50, (0, 0), 90).describe(folder)
    given = parse_subject_file(folder / "subject.toml")
    assert (given.section.contours, given.indenter.diameter_mm) == ("outline.csv", 30.0)
    assert given.instrument is None and given.origin == "measured"
    assert sorted(p.name for p in folder.iterdir()) == ["outline.csv", "recordings", "subject.toml"]
    assert len(list((folder / "recordings").iterdir())) == 3


def test_a_scan_takes_the_place_of_contours(tmp_path):
    (tmp_path / "leg.nii.gz").touch()
    PressedLeg("Mine", "leg.nii.gz", 30, 50, (0, 0), 90, 300.0).describe(tmp_path)
    section = parse_subject_file(tmp_path / "subject.toml").section
    assert (section.scan, section.contours, section.level_mm) == ("leg.nii.gz", None, 300.0)


def test_two_scans_become_a_leg_in_its_stocking(tmp_path):
    for name in ("bare.nii.gz", "in stocking.nii.gz", "notes.txt"):
        (tmp_path / name).touch()
    assert scans_in(tmp_path) == ["bare.nii.gz", "in stocking.nii.gz"]
    DressedLeg("Mine", "bare.nii.gz", "in stocking.nii.gz", "2").describe(tmp_path)
    given = parse_leg_file(tmp_path / "leg.toml")
    assert given.bare.scan == "bare.nii.gz" and given.stocking.compression_class == "2"


def _is_small(size: str, test: str) -> bool:
    """Whether a size is that of what presses or draws, and not the specimen's."""
    return test in size or size in ("opening_mm", "rim_mm")


@pytest.mark.parametrize("test", SpecimenFile.alternatives)
def test_recordings_become_specimens_that_lack_nothing(tmp_path, test):
    write_bars(tmp_path, ReducedPolynomial(5e-3, 1.0, 3e-3, np.inf))
    (tmp_path / "specimen.toml").unlink()
    for path in (tmp_path / "recordings").iterdir():
        if test == "suction":
            path.write_text(path.read_text().replace("force_N", "pressure_kPa"))
        path.rename(tmp_path / path.name)
    stated = {
        one.key[-1]: one.choices[0]
        if one.choices
        else 10.0
        if _is_small(one.key[-1], test)
        else 40.0
        for one in known_tests()[test]
        if one.needed
    }
    LabSpecimens("Mine", test, {**stated, "never stated": None}).describe(tmp_path)
    found = load_specimen(tmp_path)
    assert found.origin == "measured" and not found.left_out
    assert len(found.recordings) == len(list((tmp_path / "recordings").iterdir())) > 1
    given = parse_specimen_file(tmp_path / "specimen.toml").test
    assert {name: getattr(given, name) for name in stated} == stated
    names = {one.key[0] for one in settings_of(SpecimenFile, f"[{test}]\n")}
    assert names & set(SpecimenFile.alternatives) == {test}, "the form has no other test's numbers"


# --- who may ask ---


async def _within(scope, receive, send):
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.accept"})
        await send({"type": "websocket.close", "code": 1000})
        return
    await PlainTextResponse("within")(scope, receive, send)


@pytest.fixture
def token(workspace):
    return workspace.token()


@pytest.fixture
def visitor(token):
    return TestClient(Guard(_within, token, PORT), f"http://127.0.0.1:{PORT}",
                      follow_redirects=False)  # fmt: skip


def test_the_address_with_the_token_lets_a_browser_in_and_then_hides_it(visitor, token):
    answer = visitor.get(f"/run/x?token={token}&a=1")
    assert answer.status_code == 303 and answer.headers["location"] == "/run/x?a=1"
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie and "samesite=strict" in cookie
    assert visitor.get("/run/x").text == "within"
    assert "default-src 'self'" in visitor.get("/").headers["content-security-policy"]


@pytest.mark.parametrize("address", ["/", "/?token=", "/?token=wrong", "/?token=é"])
def test_without_the_token_nothing_is_shown(visitor, address):
    answer = visitor.get(address)
    assert answer.status_code == 403 and "no token" in answer.text
    assert "set-cookie" not in answer.headers


def test_the_token_in_an_address_changes_nothing(visitor, token):
    assert visitor.put(f"/inputs/x/y?token={token}").status_code == 403


def closed_with(visitor, headers):
    with (
        pytest.raises(WebSocketDisconnect) as closed,
        visitor.websocket_connect("/socket", headers=headers) as socket,
    ):
        socket.receive()
    return closed.value.code


@pytest.mark.parametrize(
    "headers",
    [
        {"host": "evil.example"},
        {"host": f"evil.example:{PORT}"},
        {"host": "127.0.0.1:80"},
        {"origin": "http://evil.example"},
        {"origin": "null"},
        {"origin": "http://127.0.0.1:9999"},
        {"sec-fetch-site": "same-site"},
        {"sec-fetch-site": "cross-site"},
    ],
)
def test_other_hosts_and_origins_are_refused_even_with_the_token(visitor, token, headers):
    visitor.get(f"/?token={token}")
    assert visitor.get("/", headers=headers).status_code == 403
    assert visitor.get(f"/?token={token}", headers=headers).status_code == 403
    assert closed_with(visitor, {**HOST, "cookie": f"legfem-{PORT}={token}", **headers}) == 1008


def test_a_socket_needs_the_token_too(visitor, token):
    assert closed_with(visitor, HOST) == 1008
    own = {**HOST, "origin": f"http://127.0.0.1:{PORT}", "cookie": f"legfem-{PORT}={token}"}
    with visitor.websocket_connect("/socket", headers=own) as socket:
        assert socket.receive()["code"] == 1000


# --- the server ---


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """Return the server's workspace and one who may ask; NiceGUI has one server in a process."""
    workspace = Workspace.opened(tmp_path_factory.mktemp("served"))
    guarded = Guard(application(workspace), workspace.token(), PORT)
    with TestClient(guarded, f"http://127.0.0.1:{PORT}") as visitor:
        visitor.get(f"/?token={workspace.token()}")
        yield workspace, visitor


def test_files_that_are_sent_arrive_and_others_are_refused_with_a_line(served):
    workspace, visitor = served
    name = visitor.post("/inputs", json={"name": "leg"}).json()["name"]
    assert visitor.put(f"/inputs/{name}/recordings/a.csv", content=b"1,2").status_code == 204
    assert (workspace.input(name) / "recordings" / "a.csv").read_bytes() == b"1,2"
    for path in ("..%2f..%2ftoken", "%2e%2e/%2e%2e/token", "a/..%2f..%2f..%2ftoken", ".ssh"):
        answer = visitor.put(f"/inputs/{name}/{path}", content=b"x")
        assert answer.status_code == 400 and answer.text.count("\n") == 1, path
    assert visitor.put("/inputs/..%2fruns/x", content=b"x").status_code in (400, 404)
    assert visitor.put("/inputs/none/x", content=b"x").status_code == 400
    assert len(workspace.token()) > 1


def test_only_files_of_runs_and_previews_are_shown(served):
    workspace, visitor = served
    folder = workspace.run(workspace.new_run("identify-leg"))
    (folder / "results").mkdir()
    (folder / "results" / "report.txt").write_text("found")
    (folder / "results" / "link").symlink_to("/etc/passwd")
    shown = f"/files/runs/{folder.name}/results"
    answer = visitor.get(f"{shown}/report.txt")
    assert answer.text == "found"
    assert answer.headers["content-security-policy"] == "sandbox allow-scripts"
    for path in (f"{shown}/link", f"{shown}/..%2f..%2f..%2ftoken", "/files/inputs/leg/x",
                 "/files/..%2f/token", f"{shown}/none"):  # fmt: skip
        assert visitor.get(path).status_code in (400, 404), path


def test_the_pages_show_what_stands_in_the_workspace(served):
    workspace, visitor = served
    name = workspace.new_input("a leg of mine")
    assert name in visitor.get("/").text
    assert "no plain name" in visitor.get("/input/.hidden").text
    assert "there is none" in visitor.get("/run/nothing").text
    assert visitor.get("/compare").status_code == 200
    assert visitor.get("/assets/app/press.js").status_code == 404


def test_a_port_that_is_taken_is_said_in_a_line(tmp_path, capsys):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        with pytest.raises(SystemExit) as ended:
            app(["--workspace", str(tmp_path / "new"), "--port", port, "--no-browser"])
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith(f"--port: {port}: another program has it")
    assert not (tmp_path / "new").exists()


@pytest.mark.slow
def test_the_server_starts_neither_mpi_nor_a_mesher():
    # What MPI leaves in the environment of its process would be every run's.
    script = (
        "import sys, legfem.app.server as s; "
        "print([m for m in ('mpi4py', 'petsc4py', 'dolfinx', 'gmsh') if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout == "[]\n"

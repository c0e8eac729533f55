"""The app's pages open whatever lies in the workspace: damaged, foreign, or without room for more."""

from __future__ import annotations

import asyncio
import errno
import os
import signal
import time
from pathlib import Path

import pytest
from making import write_subject

from legfem.app import workspace as module
from legfem.app.description import settings_of, with_settings
from legfem.app.runs import ACTIONS, Run, RunState, looked_at, read_json
from legfem.app.workspace import Workspace, check_within, text_of
from legfem.common.errors import InputError
from legfem.legs.schema import SubjectFile

ENCODED = {
    "Latin-1": "latin-1",
    "UTF-16 with a mark": "utf-16",
    "UTF-16 without one": "utf-16-le",
    "Mac Roman": "mac-roman",
    "UTF-8 with a mark": "utf-8-sig",
}


def leg(workspace: Workspace, name: str = "leg") -> tuple[str, Path]:
    name = workspace.new_input(name)
    write_subject(workspace.input(name))
    return name, workspace.input(name) / "subject.toml"


@pytest.mark.parametrize("how", ENCODED)
def test_a_description_in_another_encoding_opens_to_be_mended(visited, how: str) -> None:
    workspace, visitor = visited
    name, toml = leg(workspace)
    text = toml.read_text().replace('title = "', 'title = "Bein für Größe ')
    toml.write_bytes(text.encode(ENCODED[how]))
    answer = visitor.get(f"/input/{name}")
    assert answer.status_code == 200 and "as text" in answer.text
    if "without" not in how:
        mended = with_settings(text_of(toml), {("indenter", "diameter_mm"): 31.0})
        toml.write_text(mended, encoding="utf-8")
        kept = {one.name: one.value for one in settings_of(SubjectFile, text_of(toml))}
        assert kept["indenter.diameter_mm"] == 31.0
        assert kept["title"].startswith("Bein f\xfcr") or how == "Mac Roman"


@pytest.mark.parametrize(
    "content", ["", "{", "null", "[]", "3", '{"about": "leg"}', '{"about": 1, "arguments": 2}', "\0"]
)
def test_a_damaged_run_takes_no_page_with_it(visited, content: str) -> None:
    workspace, visitor = visited
    whole = Run.written(workspace.run(workspace.new_run("identify-whole")), "legfem.identify", [], "leg")
    damaged = workspace.run(workspace.new_run("identify-damaged"))
    (damaged / "run.json").write_text(content)
    for path in ("/", "/compare", f"/run/{damaged.name}", f"/run/{whole.folder.name}"):
        answer = visitor.get(path)
        assert answer.status_code == 200, path
        assert "run.json is damaged" in answer.text or path.endswith(whole.folder.name)
    for kind in ("csv", "xlsx"):
        assert visitor.get(f"/table.{kind}").status_code == 200
    assert "run.json is damaged" in visitor.get("/table.csv").text


WAITS = """
import pathlib, sys, time
out = pathlib.Path(sys.argv[1])
time.sleep(1)
out.mkdir()
(out / "report.txt").write_text(sys.argv[2])
sys.exit(0)
"""


@pytest.mark.parametrize("finishes", [True, False])
def test_a_run_whose_supervisor_died_says_whether_it_finished(workspace, tmp_path, monkeypatch, finishes: bool) -> None:
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
    (tmp_path / "pretended.py").write_text(WAITS if finishes else WAITS.replace("(out", "sys.exit(1)\n(out"))
    folder = workspace.run(workspace.new_run("identify-leg"))
    run = Run.begun(folder, "pretended", [str(folder / "results"), "found"], "leg")
    leader = read_json(run.folder / "session.json")["leader"]
    time.sleep(0.7)
    os.kill(leader, signal.SIGKILL)
    os.waitpid(leader, 0)
    end = time.monotonic() + 30
    while run.alive:
        assert time.monotonic() < end
        time.sleep(0.05)
    assert run.state is (RunState.DONE if finishes else RunState.LOST)
    if finishes:
        os.utime(folder / "results" / "report.txt", (1, 1))  # of an earlier start
        assert run.state is RunState.LOST


@pytest.mark.parametrize("named", ["/", "../", "absolute"])
def test_what_lies_in_another_folder_is_refused(visited, named: str) -> None:
    workspace, visitor = visited
    _, other = leg(workspace, "another")
    name, toml = leg(workspace)
    path = {"/": "/etc/passwd", "../": "../another/contours.csv", "absolute": str(other.with_name("contours.csv"))}[
        named
    ]
    assert (toml.parent / path).exists()
    toml.write_text(toml.read_text().replace('"contours.csv"', f'"{path}"'))
    line = f"subject.toml: {path}: lies in another folder; add the file here, and name it"
    for attempt in (
        lambda: check_within(toml.parent),
        lambda: looked_at(workspace, name),
        lambda: ACTIONS["subject.toml"][0].options(toml.parent, Path("out"), {}),
    ):
        with pytest.raises(InputError) as refused:
            attempt()
        assert str(refused.value) == line
    answer = visitor.get(f"/input/{name}")
    assert answer.status_code == 200 and "lies in another folder" in answer.text and "as text" in answer.text
    assert not (workspace.folder / "previews" / name).exists()


def test_names_that_are_no_paths_are_none(workspace) -> None:
    _, toml = leg(workspace)
    toml.write_text(toml.read_text() + f'\n[more]\na = ["x\\u0000", {"y" * 5000!r}, "/nowhere/at/all", ""]\n')
    check_within(toml.parent)


def test_an_input_s_page_opens_on_a_full_disk(visited, monkeypatch) -> None:
    workspace, visitor = visited
    name, _ = leg(workspace)

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "mkdir", full)
    answer = visitor.get(f"/input/{name}")
    assert answer.status_code == 200
    assert "No space left on device" in answer.text and "Files" in answer.text


def test_an_upload_has_a_limit(workspace, monkeypatch) -> None:
    monkeypatch.setattr(module, "_MOST_BYTES", 1000)
    name = workspace.new_input("leg")

    async def pieces(count: int):
        for _ in range(count):
            yield b"x" * 100

    asyncio.run(workspace.receive(name, "a.nii", pieces(10)))
    with pytest.raises(InputError, match=r"upload: b\.nii: has more than 0 MB; cut the scan to the leg"):
        asyncio.run(workspace.receive(name, "b.nii", pieces(11)))
    assert [path.name for path in workspace.input(name).iterdir()] == ["a.nii"]

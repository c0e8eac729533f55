"""The app's workspace: inputs, uploads and names, as files."""

import asyncio

import pytest
from starlette.requests import ClientDisconnect

from legfem.app.workspace import plain_name
from legfem.common.errors import InputError
from legfem.common.resources import RESOURCES

SUBJECT = RESOURCES / "frauziols" / "subjects" / "3"


async def pieces(*parts):
    for part in parts:
        if isinstance(part, Exception):
            raise part
        yield part


def received(workspace, name, path, *parts):
    return asyncio.run(workspace.receive(name, path, pieces(*parts)))


@pytest.mark.parametrize("name", ["", ".", "..", "../x", "a/b", "a\\b", ".bashrc", "a\0", "-rf", "~", "C:x", "x" * 300])
def test_names_that_could_lead_out_of_a_folder_are_refused(name):
    with pytest.raises(InputError, match="not a plain name"):
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


def test_the_workspace_is_for_the_user_alone(workspace):
    assert workspace.folder.stat().st_mode & 0o077 == 0


def test_a_changed_input_is_looked_at_anew(workspace):
    name = workspace.copied(SUBJECT, "leg")
    before = workspace.preview(name)
    assert workspace.preview(name) == before
    toml = workspace.input(name) / "subject.toml"
    toml.write_text(toml.read_text() + "\n")
    assert workspace.preview(name) != before

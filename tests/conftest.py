"""What several tests look at; the folder is put on the path for its helpers."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import browser
import pytest
from driving import Driven
from making_mechanics import subject_3
from making_scans import write_leg
from making_specimens import PLANTED, write_bars
from making_stocking import write_scanned
from walking import Server

from legfem.app.runs import Run
from legfem.app.workspace import Workspace
from legfem.experiments.plane_strain import PlaneStrainIndentation
from legfem.legs import unknowns
from legfem.legs.finite_element_models import solved_responses

if TYPE_CHECKING:
    from starlette.testclient import TestClient


@pytest.fixture(scope="session", autouse=True)
def errors_of_geometry(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Keep what errors of outlines do in one folder of all tests and processes, under the key of what it depends on.

    Every identification of a leg asks for it, and most tests' legs have the same outlines.
    """
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "responses"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(unknowns, "solved_responses", lambda leg, observed, _: solved_responses(leg, observed, folder))
        yield folder


@pytest.fixture(scope="session")
def subject_3_test() -> PlaneStrainIndentation:
    """Subject 3 with the default settings."""
    return PlaneStrainIndentation(*subject_3())


@pytest.fixture
def workspace(tmp_path) -> Workspace:
    """An empty one."""
    return Workspace.opened(tmp_path / "workspace")


@pytest.fixture(scope="session")
def bars(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of specimens: bars of a planted law, compressed at three rates."""
    return write_bars(tmp_path_factory.mktemp("bars"), PLANTED)


@pytest.fixture(scope="session")
def scanned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of a short leg for a stocking, as contours: those are read at once, a scan in ten seconds."""
    return write_scanned(tmp_path_factory.mktemp("scanned"))


@pytest.fixture(scope="session")
def leg_files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One leg as label volumes, surfaces and cross-sections."""
    folder = tmp_path_factory.mktemp("leg")
    write_leg(folder)
    return folder


@pytest.fixture(scope="session")
def visited(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Workspace, TestClient]]:
    """Return a server's workspace and one who may ask, in this process: NiceGUI has one server in each."""
    from starlette.testclient import TestClient

    from legfem.app.guard import Guard
    from legfem.app.server import application

    workspace = Workspace.opened(tmp_path_factory.mktemp("visited"))
    (workspace.folder / "token").write_text("for the user alone")
    with TestClient(Guard(application(workspace), "secret", 8765), "http://127.0.0.1:8765") as visitor:
        visitor.get("/?token=secret")
        yield workspace, visitor


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Workspace, str]]:
    """Return the workspace of a server that runs, and its address with the token."""
    workspace = tmp_path_factory.mktemp("served") / "workspace"
    server = Server((sys.executable,), workspace)
    address = server.start()
    with server:
        yield Workspace(workspace), address
    for name in Workspace(workspace).runs:
        Run(workspace / "runs" / name).cancel(at_once=True)


@pytest.fixture
def page(served: tuple[Workspace, str]) -> Iterator[Driven]:
    """Return a browser at the server's first page; nothing may go wrong in it."""
    _, address = served
    with Driven(browser.browser()) as page:
        page.resize(1280, 900)
        page.open(address)
        page.sees("Drop a folder here")
        yield page
        assert page.faults == []

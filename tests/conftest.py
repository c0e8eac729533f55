"""What several tests look at; the folder is put on the path for its helpers."""

from __future__ import annotations

from pathlib import Path

import pytest
from making_mechanics import subject_3
from making_scans import write_leg
from making_specimens import PLANTED, write_bars

from legfem.app.workspace import Workspace
from legfem.experiments.plane_strain import PlaneStrainIndentation


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
def leg_files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One leg as label volumes, surfaces and cross-sections."""
    folder = tmp_path_factory.mktemp("leg")
    write_leg(folder)
    return folder

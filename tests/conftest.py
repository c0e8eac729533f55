"""What several tests look at; the folder is put on the path for its helpers."""

from __future__ import annotations

import pytest
from making_mechanics import subject_3

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

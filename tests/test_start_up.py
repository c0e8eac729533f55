"""How little a command loads before it works."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = ("SimpleITK", "dolfinx", "gmsh", "matplotlib", "pandas", "trimesh")


@pytest.mark.parametrize("command", ["diagnose", "identify", "plan"])
def test_a_command_starts_without_solver_images_and_plots(command: str) -> None:
    code = f"import sys, legfem.commands.{command}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not set(HEAVY) & set(done.stdout.split())

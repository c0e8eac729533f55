"""Reading instruments' files needs nothing that solves: no finite elements, no inverse problem, no kind of it."""

from __future__ import annotations

import subprocess
import sys

from making import press, write_recording

_ALONE = """
import sys

SOLVING = ("dolfinx", "ufl", "basix", "ffcx", "petsc4py", "mpi4py", "gmsh")
ROOMS = ("inverse", "legs", "specimens", "stockings", "fem", "solve", "experiments", "meshing", "mechanics", "report")


class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in SOLVING or name in {f"legfem.{room}" for room in ROOMS}:
            raise ModuleNotFoundError(name)


sys.meta_path.insert(0, Missing())
from pathlib import Path

from legfem.data.columns import propose
from legfem.data.formats import read_sheets
from legfem.data.recording import recording_of
from legfem.data.segmentation import segment

path = Path(sys.argv[1])
sheets = read_sheets(path)
channels = propose(path, sheets).channels
print(channels.force.unit, *segment(recording_of(path, sheets, channels)).phases)
"""


def test_a_file_becomes_sheet_units_clock_and_phases_without_what_solves(tmp_path):
    path = write_recording(tmp_path / "trial.csv", press(hold=5, unload=True))
    done = subprocess.run([sys.executable, "-c", _ALONE, str(path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["N", "loading", "hold", "unloading"]

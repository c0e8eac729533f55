"""Run by mpirun: `identify --model 3d` of a small cone with large elements, saved from rank 0."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import typer
from making_legs_3d import cone_folder
from mpi4py import MPI

from legfem.commands.identify import app
from legfem.data import Recording
from legfem.experiments.leg_3d import SolidLegSettings
from legfem.legs import model_3d as spatial
from legfem.meshing.leg_sizes import SolidMeshSettings

out = Path(sys.argv[1])
comm = MPI.COMM_WORLD
place = out.with_suffix("") / "leg"
if comm.rank == 0:
    place.mkdir(parents=True)
    time = np.arange(0.0, 12.8, 0.1)
    trials = [
        Recording(time, 0.4 * time, gain * 0.14 * (0.4 * time) ** 1.3, f"trial {gain}") for gain in (0.98, 1.0, 1.02)
    ]
    cone_folder(place, level=100.0, more="length_mm = 70.0", recordings=trials)
comm.Barrier()
mesh = SolidMeshSettings(skin_size=25.0, inside_size=30.0, bone_size=20.0, layer_elements=0.25, turn_elements=7.0)
settings = SolidLegSettings(mesh=mesh, contact_size=18.0)
setattr(spatial, "SolidLegSettings", lambda: settings)  # noqa: B010
results = out.with_suffix("") / "results"
asked = ["--subject-dir", place, "--model", "3d", "--law", "neo-hookean", "--out", results]
try:
    app([*map(str, asked), "--jobs", "1", "--quiet"], standalone_mode=False)
except typer.Exit as end:
    assert end.exit_code == 0
if comm.rank == 0:
    found = json.loads((results / "result.json").read_text())["laws"]["neo-hookean"]
    one = found["parameters"]["c10_deep"]
    solves = found["spatial"]
    np.savez(
        out,
        ranks=comm.size,
        value=one["value"],
        ci95=one["ci95"],
        force=found["curve"]["force_N"],
        solves=solves["full_solves"],
    )

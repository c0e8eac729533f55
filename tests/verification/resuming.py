"""Run by mpirun: press a tiny idealised leg, killed on the way and gone on with, or whole."""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI

from legfem.experiments.indenter_pose import Cylinder
from legfem.experiments.leg_3d import IdealisedLegIndentation, IdealisedLegSettings
from legfem.jobs.store import Checkpoint
from legfem.mechanics.materials import ReducedPolynomial
from legfem.meshing.structured import IdealisedLeg, LegMeshSettings

how, out = sys.argv[1], Path(sys.argv[2])
mesh = LegMeshSettings(contact_size=12, depth_size=20, edge_size=8, growth=0.5, far_size=40)
tissue = {"deep": ReducedPolynomial(2e-3, 28.0, 0.0)}
setattr(Checkpoint, "due", True)  # noqa: B010


class KilledError(Exception):
    """Stands for a kill."""


def pressed(kill_at: float):
    """Press to 3 mm, on another mesh object every time, as another process would."""
    settings = IdealisedLegSettings(mesh=mesh)
    leg = IdealisedLeg(length=60)
    test = IdealisedLegIndentation(leg, Cylinder(), tissue, 3, settings, MPI.COMM_WORLD)
    walked: list[float] = []

    def on_step(at: float) -> None:
        walked.append(at)
        if at > kill_at:
            raise KilledError

    solved = test.solve(depth=3.0, on_step=on_step, keep_in=out.parent / f"{how}-states")
    return solved, walked


if how == "killed":
    with contextlib.suppress(KilledError):
        pressed(1.0)
solved, walked = pressed(np.inf)
if MPI.COMM_WORLD.rank == 0:
    np.savez(
        out,
        ranks=MPI.COMM_WORLD.size,
        first=walked[0],
        displacement=solved.curve.displacement,
        force=solved.curve.force,
    )

"""Run by mpirun: P(d) of a tiny idealised leg, saved from rank 0."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from legfem.experiments.leg_3d import IdealisedLegSettings
from legfem.inverse.correction import smooth_ratio
from legfem.meshing.structured import IdealisedLeg, LegMeshSettings
from legfem.solve.linear import LinearSettings
from legfem.study.correction.cases import CorrectionCase, solve_case

mesh = LegMeshSettings(contact_size=8, depth_size=16, edge_size=8, growth=0.5, far_size=40)
linear = replace(LinearSettings(), solver=sys.argv[1])
settings = IdealisedLegSettings(mesh=mesh, linear=linear)
outcome = solve_case(CorrectionCase(IdealisedLeg(length=90), settings=settings, depth=6.0), comm=MPI.COMM_WORLD)
displacement = np.linspace(0, 6, 13)
if MPI.COMM_WORLD.rank == 0:
    np.savez(
        sys.argv[2],
        ranks=MPI.COMM_WORLD.size,
        P=smooth_ratio(outcome.spatial, outcome.plane, displacement),
        pressure=outcome.skin[:, -1],
    )

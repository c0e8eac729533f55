"""Run by mpirun: press subject 3's section and save the curve, from rank 0."""

from __future__ import annotations

import sys

import numpy as np
from making_mechanics import COARSE, subject_3
from mpi4py import MPI

from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.solve.protocol import Protocol
from legfem.solve.settings import NewtonSettings, StepSettings

# Where an update's gain is near what is asked of it, rounding says whether factors are made anew.
settings = PlaneStrainSettings(
    mesh=COARSE,
    formulation=sys.argv[1],
    steps=StepSettings.regular(curve_tolerance=2e-3),
    newton=NewtonSettings(1e-10, reuse=0.7, keeps_body=True),
)
test = PlaneStrainIndentation(*subject_3(), settings, comm=MPI.COMM_WORLD)
parameters = ("deep.C10", "deep.C20", "superficial.C10", "fascia.C10")
solved = test.solve(None, Protocol.through((3.0, 2.0), rate=1.0), parameters)
balance = test.system.balance()
if MPI.COMM_WORLD.rank == 0:
    np.savez(
        sys.argv[2],
        ranks=MPI.COMM_WORLD.size,
        displacement=solved.path.displacement,
        force=solved.path.force,
        sensitivities=np.array([solved.curve.sensitivities[name] for name in parameters]),
        contact=balance.contact_force,
        bone=balance.bone_reaction,
        works=[balance.contact_work, balance.internal_work],
        factorisations=solved.report.factorisations,
    )

"""Run by mpirun: take a folder for results on all ranks, and save which of them were refused."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI

from legfem.common.command_line import results_folder
from legfem.common.errors import InputError

refused = 0
try:
    with results_folder(Path(sys.argv[1]), "x", MPI.COMM_WORLD):
        MPI.COMM_WORLD.Barrier()
except InputError:
    refused = 1
every = MPI.COMM_WORLD.gather(refused)
if MPI.COMM_WORLD.rank == 0:
    np.savez(Path(sys.argv[2]), ranks=MPI.COMM_WORLD.size, refused=every)

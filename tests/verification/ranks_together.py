"""Run by mpirun: tasks that all ranks do at once, one of which is a user's mistake."""

from __future__ import annotations

import sys

import numpy as np
from mpi4py import MPI

from legfem.common.errors import InputError
from legfem.jobs.pool import Together, leading

comm = MPI.COMM_WORLD


def count(context: list[int], task: int) -> int:
    """Return what all ranks were given so far, added up."""
    if task < 0:
        raise InputError("task", f"{task}", "is negative", "give 0 or more")
    context.append(task)
    return comm.allreduce(sum(context))


found, refused = [], ""
try:
    with leading(comm) as first:
        if first:
            one, other = Together(comm, count, [1]), Together(comm, count, [1])
            found = [one.do(10), other.do(20), one.do(30)]
            one.do(-1)
except InputError as error:
    refused = str(error)
comm.Barrier()
if comm.rank == 0:
    np.savez(sys.argv[1], ranks=comm.size, found=found, refused=refused)

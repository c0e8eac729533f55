"""Commands whose solves in 3D are spread over the ranks of an MPI job."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import petsc4py.PETSc  # noqa: F401  (it starts on all ranks together)
import typer
from mpi4py import MPI

from legfem.common.command_line import command_context, process_count
from legfem.common.errors import InputError
from legfem.jobs.ranks import leading


@contextmanager
def spread_edge(jobs: int | None, resume: str, quiet: bool = False) -> Iterator[int]:
    """As `legfem.common.command_line.parallel_context`, but the other ranks join in the first's solves."""
    comm = MPI.COMM_WORLD
    with command_context(resume, quiet), leading(comm, (InputError, typer.Exit)) as first:
        if not first:
            raise typer.Exit(0)
        yield process_count(jobs, comm.size)

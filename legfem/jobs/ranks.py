"""Tasks over the ranks of an MPI job: the first one hands out and collects, and works too."""

from __future__ import annotations

import pickle
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextvars import ContextVar
from typing import Any

from mpi4py import MPI

from legfem.common.errors import InputError

_RESULT = 7

_collect: ContextVar[Callable[[], None]] = ContextVar("collect", default=lambda: None)


def take_in() -> None:
    """Take in what other ranks have done meanwhile; a long task calls it now and then.

    Does nothing but in a task that is spread over ranks, on the first.
    """
    _collect.get()()


def over_ranks(
    comm: MPI.Intracomm, work: Callable[..., Any], context: Any, tasks: Sequence[Any]
) -> Iterator[tuple[int, Any]]:
    """Yield places in the list with outcomes; every rank does each ``size``-th task."""
    comm.bcast((work, pickle.dumps(context), list(tasks)))
    arrived: list[tuple[int, Any]] = []

    def collect() -> None:
        while comm.iprobe(tag=_RESULT):
            arrived.append(comm.recv(tag=_RESULT))

    remaining = len(tasks)
    for place in range(0, len(tasks), comm.size):
        before = _collect.set(collect)
        try:
            arrived.append((place, work(context, tasks[place])))
        finally:
            _collect.reset(before)
        collect()
        remaining -= len(arrived)
        yield from arrived
        arrived.clear()
    for _ in range(remaining):
        yield comm.recv(tag=_RESULT)


def lead(comm: MPI.Intracomm, work: Callable[[], None]) -> None:
    """Do work on the first rank; the others do the tasks of its `Workers`.

    Ctrl-C and errors end all ranks; a user's mistake is raised on the first.
    """
    if comm.size == 1:
        work()
        return
    mistake = None
    try:
        if comm.rank > 0:
            _serve(comm)
        else:
            try:
                work()
            except InputError as error:
                mistake = error
            comm.bcast(None)
    except BaseException as error:
        # The others may wait to hand in an outcome: they can't be told any more.
        interrupted = isinstance(error, KeyboardInterrupt)
        if interrupted:
            print("interrupted: run the same command again to go on", file=sys.stderr)
        else:
            traceback.print_exc()
        sys.stderr.flush()
        comm.Abort(130 if interrupted else 1)
    if mistake is not None:
        raise mistake


def _serve(comm: MPI.Intracomm) -> None:
    """Do tasks until the first rank has no more."""
    last, context = b"", None
    while (given := comm.bcast(None)) is not None:
        work, pickled, tasks = given
        if pickled != last:  # else what tasks made of the context, their meshes, stays
            last, context = pickled, pickle.loads(pickled)
        for place in range(comm.rank, len(tasks), comm.size):
            comm.send((place, work(context, tasks[place])), dest=0, tag=_RESULT)

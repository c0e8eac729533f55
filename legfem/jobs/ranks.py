"""Tasks over the ranks of an MPI job: the first one hands out and collects, and works too.

Either every rank does tasks of its own (`over_ranks`), or all do one task together (`Together`).
"""

from __future__ import annotations

import pickle
import sys
import traceback
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any, NoReturn

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
    comm.bcast(_Apart(work, pickle.dumps(context), list(tasks)))
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


class Together[Context, Task, Outcome]:
    """Tasks that all ranks do at once, each with its own copy of a context.

    This is the first rank, the others serve it, as `leading` has it. What tasks make of the
    context, a mesh or compiled forms, stays on every rank.

    Parameters
    ----------
    comm
        The ranks.
    work
        Function of a context and a task, defined in a module; collective over ``comm``.
    context
        Picklable; all of it that is collective has to be made by tasks.
    """

    def __init__(self, comm: MPI.Intracomm, work: Callable[[Context, Task], Outcome], context: Context) -> None:
        self._comm, self._work, self._context = comm, work, context
        self._name = uuid.uuid4().hex
        self._sent = False

    def do(self, task: Task) -> Outcome:
        """Return the first rank's outcome of a task."""
        if self._comm.size > 1:
            pickled = None if self._sent else pickle.dumps(self._context)
            self._comm.bcast(_Joint(self._work, self._name, pickled, task))
            self._sent = True
        return self._work(self._context, task)


def lead(comm: MPI.Intracomm, work: Callable[[], None]) -> None:
    """Call a function on the first rank while the others serve it, see `leading`."""
    with leading(comm) as first:
        if first:
            work()


@contextmanager
def leading(comm: MPI.Intracomm, expected: tuple[type[Exception], ...] = (InputError,)) -> Iterator[bool]:
    """Yield True on the first rank, whose `Workers` and `Together` the others serve.

    On the others False, after that. Ctrl-C and errors end all ranks; those that are ``expected`` are
    raised on the first.
    """
    if comm.size == 1:
        yield True
        return
    if comm.rank > 0:
        try:
            _serve(comm)
        except BaseException as error:
            _end_all(comm, error)
        yield False
        return
    try:
        yield True
    except expected:
        comm.bcast(None)
        raise
    except BaseException as error:
        _end_all(comm, error)
    comm.bcast(None)


def _end_all(comm: MPI.Intracomm, error: BaseException) -> NoReturn:
    """End all ranks: others may wait to hand in an outcome, and can't be told any more."""
    interrupted = isinstance(error, KeyboardInterrupt)
    if interrupted:
        print("interrupted: run the same command again to go on", file=sys.stderr)
    else:
        traceback.print_exception(error)
    sys.stderr.flush()
    comm.Abort(130 if interrupted else 1)
    raise error


@dataclass(frozen=True)
class _Apart:
    """Tasks of which every rank does some; the context is pickled."""

    work: Callable[..., Any]
    context: bytes
    tasks: list[Any]


@dataclass(frozen=True)
class _Joint:
    """A task that all ranks do; the context is pickled when its name is given first."""

    work: Callable[..., Any]
    name: str
    context: bytes | None
    task: Any


def _serve(comm: MPI.Intracomm) -> None:
    """Do tasks until the first rank has no more."""
    last, context = b"", None
    named: dict[str, Any] = {}
    while (given := comm.bcast(None)) is not None:
        if isinstance(given, _Joint):
            if given.context is not None:
                named[given.name] = pickle.loads(given.context)
            # A user's mistake is found on all ranks, and said by the first.
            with suppress(InputError):
                given.work(named[given.name], given.task)
            continue
        if given.context != last:  # else what tasks made of the context, their meshes, stays
            last, context = given.context, pickle.loads(given.context)
        for place in range(comm.rank, len(given.tasks), comm.size):
            comm.send((place, given.work(context, given.tasks[place])), dest=0, tag=_RESULT)

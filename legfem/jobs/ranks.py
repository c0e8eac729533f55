"""The ranks of an MPI job: the first one leads and works too, the others serve it.

Either every rank does tasks of its own (`over_ranks`, by mpi4py.futures), or all do one task together (`Together`).
"""

import pickle
import sys
import traceback
import uuid
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, NoReturn

from mpi4py import MPI
from mpi4py.futures import MPICommExecutor

from legfem.common.errors import InputError

shared: list[object] = []
"""The context of the tasks that this process or rank is given, made once."""


def with_context[Task, Outcome](work: Callable[..., Outcome], task: Task) -> Outcome:
    """Do a task with the context that this process or rank has."""
    return work(shared[0], task)


@contextmanager
def over_ranks(comm: MPI.Intracomm, context: object) -> Iterator[Executor]:
    """Yield an executor of all ranks but the first, which is to work along; they have a context for `with_context`."""
    comm.bcast(_Apart(pickle.dumps(context)))
    first: Any = MPICommExecutor(comm, root=0)
    with first as executor:
        yield executor


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
    """A context, pickled, with which an executor's tasks are done."""

    context: bytes


@dataclass(frozen=True)
class _Joint:
    """A task that all ranks do; the context is pickled when its name is given first."""

    work: Callable[..., Any]
    name: str
    context: bytes | None
    task: Any


def _serve(comm: MPI.Intracomm) -> None:
    """Do tasks until the first rank has no more."""
    last = b""
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
            last, shared[:] = given.context, [pickle.loads(given.context)]
        with MPICommExecutor(comm, root=0):
            pass

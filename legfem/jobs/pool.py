"""Many tasks on one process, several, or the ranks of an MPI job, which Ctrl-C ends; what leads the ranks.

Of ranks the first one leads and works too, the others serve it. Either every rank does tasks of its own (`Workers`,
by mpi4py.futures), or all do one task together (`Together`).
"""

import multiprocessing
import os
import pickle
import signal
import sys
import threading
import traceback
import uuid
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from queue import SimpleQueue
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any, NoReturn

from legfem.common.command_line import INTERRUPTS, ignore_broken_pipes
from legfem.common.errors import InputError

if TYPE_CHECKING:
    from mpi4py import MPI


@dataclass(frozen=True)
class _Apart:
    """A context, pickled, with which an executor's tasks are done."""

    context: bytes


shared: list[object] = []
"""The context of the tasks that this process or rank is given, made once."""


def with_context[Task, Outcome](work: Callable[..., Outcome], task: Task) -> Outcome:
    """Do a task with the context that this process or rank has, which the first task unpickles."""
    if isinstance(shared[0], _Apart):
        shared[:] = [pickle.loads(shared[0].context)]
    return work(shared[0], task)


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

    def __init__(self, comm: "MPI.Intracomm", work: Callable[[Context, Task], Outcome], context: Context) -> None:
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
def leading(comm: "MPI.Intracomm", expected: tuple[type[Exception], ...] = (InputError,)) -> Iterator[bool]:
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


def _end_all(comm: "MPI.Intracomm", error: BaseException) -> NoReturn:
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
class _Joint:
    """A task that all ranks do; the context is pickled when its name is given first."""

    work: Callable[..., Any]
    name: str
    context: bytes | None
    task: Any


def _serve(comm: "MPI.Intracomm") -> None:
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
            last, shared[:] = given.context, [given]
        from mpi4py.futures import MPICommExecutor

        with MPICommExecutor(comm, root=0):
            pass


@contextmanager
def interruptible() -> Iterator[None]:
    """Raise KeyboardInterrupt in the end where an interrupt got lost on the way.

    One that arrives in a callback of PETSc's becomes an error of PETSc's, which looks like a solve
    that failed.
    """
    main = threading.current_thread() is threading.main_thread()
    there = {one: signal.getsignal(one) for one in (INTERRUPTS if main else ())}
    handlers = {one: handler for one, handler in there.items() if callable(handler)}
    interrupted = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal interrupted
        interrupted = True
        handlers[signal.Signals(number)](number, frame)

    for one in handlers:
        signal.signal(one, note)
    try:
        yield
    finally:
        for one, handler in handlers.items():
            signal.signal(one, handler)
        if interrupted:
            raise KeyboardInterrupt


@dataclass(eq=False)
class Workers[Context, Task, Outcome]:
    """Runs tasks that share a context, a mesh or compiled forms; a context manager.

    Ctrl-C ends the processes at once, and they end themselves when the one that started them is
    killed. What a task raises, or the import of its function, is raised here. A process that ends
    without an outcome raises BrokenProcessPool that says how, of which `legfem.common.command_line` makes a line.

    Parameters
    ----------
    work
        Function of a context and a task, defined in a module. Picklable, as are context and tasks, if
        there are several processes or ranks.
    context
        Sent to every process once.
    jobs
        Processes; 1 works in this one.
    comm
        Over whose ranks tasks are spread if there are several: this is the first, and the others
        serve it, as `legfem.jobs.pool.leading` has it.
    along
        Whether this process is one of those that work, for tasks of seconds: what others finish
        meanwhile isn't yielded before its own task is.
    """

    work: Callable[[Context, Task], Outcome]
    context: Context
    jobs: int = 1
    comm: "MPI.Intracomm | None" = None
    along: bool = False
    _executor: "Processes | None" = field(default=None, init=False)

    def __enter__(self) -> "Workers[Context, Task, Outcome]":
        """Return itself; processes start with the first several tasks."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the processes; after an error without waiting for the task in hand."""
        if self._executor is not None:
            self._executor.__exit__(kind, error, trace)

    def run(self, tasks: Sequence[Task]) -> Iterator[tuple[Task, Outcome]]:
        """Yield tasks with their outcomes as they become known, in any order."""
        for place, outcome in self.places(tasks):
            yield tasks[place], outcome

    def in_order(self, tasks: Sequence[Task]) -> Iterator[Outcome]:
        """Yield outcomes in the tasks' order, each as soon as those before it are known."""
        found: dict[int, Outcome] = {}
        last = 0
        for place, outcome in self.places(tasks):
            found[place] = outcome
            while last in found:
                yield found.pop(last)
                last += 1

    def places(self, tasks: Sequence[Task]) -> Iterator[tuple[int, Outcome]]:
        """Yield tasks' places in the list with their outcomes as they become known."""
        if self.comm is not None and self.comm.size > 1:
            self.comm.bcast(_Apart(pickle.dumps(self.context)))
            from mpi4py.futures import MPICommExecutor

            ranks: Any = MPICommExecutor(self.comm, root=0)
            with ranks as others:
                yield from self._working_along(others, self.comm.size - 1, tasks)
        elif self.jobs == 1 or (len(tasks) < 2 and (self.along or self._executor is None)):
            for place, task in enumerate(tasks):
                yield place, self._done_here(task)
        else:
            executor = self._executor = self._executor or Processes(self.jobs - self.along, self.context)
            try:
                if self.along:
                    yield from self._working_along(executor, self.jobs - 1, tasks)
                    return
                futures = {executor.submit(with_context, self.work, t): k for k, t in enumerate(tasks)}
                for future in as_completed(futures):
                    yield futures[future], future.result()
            except BrokenProcessPool as error:
                raise BrokenProcessPool(f"a worker process {how_ended(executor)}") from error

    def start(self, ready: Callable[[Context], None], most: int) -> None:
        """Start up to ``most`` processes, which get ready while this one goes on.

        What getting ready raises is left to a task.
        """
        if self.jobs == 1 or (self.comm is not None and self.comm.size > 1):
            return
        self._executor = self._executor or Processes(self.jobs - self.along, self.context)
        for _ in range(min(most, self.jobs - self.along)):
            self._executor.submit(with_context, _made_ready, ready)

    def _done_here(self, task: Task) -> Outcome:
        with interruptible():
            return self.work(self.context, task)

    def _working_along(self, executor: Executor, others: int, tasks: Sequence[Task]) -> Iterator[tuple[int, Outcome]]:
        """Yield as `places` does; whoever is free takes the next task."""
        waiting = deque(enumerate(tasks))
        done: SimpleQueue[tuple[int, Future[Outcome]]] = SimpleQueue()

        def hand_on() -> None:
            if (one := _first_of(waiting)) is not None:
                place, task = one
                future = executor.submit(with_context, self.work, task)
                future.add_done_callback(lambda made: taken(place, made))

        def taken(place: int, future: Future[Outcome]) -> None:
            done.put((place, future))
            if not (future.cancelled() or future.exception()):
                hand_on()

        for _ in range(others):
            hand_on()
        for _ in tasks:
            mine = _first_of(waiting) if done.empty() else None
            if mine is None:
                place, future = done.get()
                yield place, future.result()
            else:
                place, task = mine
                yield place, self._done_here(task)


def how_ended(executor: Executor) -> str:
    """Return how the first process of a broken executor ended that wasn't ended for another's sake."""
    started = list((getattr(executor, "_processes", None) or {}).values())
    executor.shutdown(wait=True, cancel_futures=True)
    codes = [process.exitcode for process in started if process.exitcode not in (None, 0, -signal.SIGTERM)]
    if codes and codes[0] > 0:
        return f"ended by itself with status {codes[0]}, and said why"
    return "was ended from outside (out of memory?)"


class Processes(ProcessPoolExecutor):
    """Processes that end at once with an error, Ctrl-C, and the one that started them.

    The unpickling of a task, and of what it raises, is part of the task.
    A `ProcessPoolExecutor` breaks down where a worker can't import a task's function or unpickle its arguments, or
    where an exception that was pickled can't be unpickled, and then says as much as of a process that was killed.
    """

    def __init__(self, number: int, context: object = None) -> None:
        ignore_broken_pipes()
        given = (_Apart(pickle.dumps(context)),)
        super().__init__(number, mp_context=multiprocessing.get_context("spawn"), initializer=_start, initargs=given)

    def submit[**Given, Outcome](
        self, fn: Callable[Given, Outcome], /, *args: Given.args, **kwargs: Given.kwargs
    ) -> Future[Outcome]:
        """Hand over a call."""
        return super().submit(_unpickled_call, pickle.dumps((fn, args, kwargs)))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the processes; after an error without waiting for the task in hand."""
        if kind is not None:
            ignore_broken_pipes()
            for process in list((self._processes or {}).values()):
                process.kill()
        self.shutdown(wait=True, cancel_futures=True)


def _unpickled_call(call: bytes) -> Any:
    function, args, kwargs = pickle.loads(call)
    try:
        return function(*args, **kwargs)
    except Exception as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:
            raise RuntimeError("".join(traceback.format_exception_only(error)).strip()) from None
        raise


def _start(context: _Apart) -> None:
    # Ctrl-C reaches the whole process group; the parent ends the workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    shared[:] = [context]


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _made_ready[Context](context: Context, ready: Callable[[Context], None]) -> None:
    ready(context)


def _first_of[Item](waiting: deque[Item]) -> Item | None:
    with suppress(IndexError):
        return waiting.popleft()
    return None

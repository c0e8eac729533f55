"""Many tasks on one process, several, or the ranks of an MPI job."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from types import TracebackType

from mpi4py import MPI

from legfem.jobs.interrupt import interruptible
from legfem.jobs.ranks import over_ranks


class Workers[Context, Task, Outcome]:
    """Runs tasks that share a context, a mesh or compiled forms; a context manager.

    Ctrl-C ends the processes at once, and they end themselves when the one that started them is
    killed. A process that is killed from outside raises BrokenProcessPool, of which
    `legfem.common.command_edge` makes a line.

    Parameters
    ----------
    work
        Of a context and a task; a function of a module. Picklable, as are context and tasks, if
        there are several processes or ranks.
    context
        Sent to every process once.
    jobs
        Processes; 1 works in this one.
    comm
        Over whose ranks tasks are spread if there are several: this is the first, and the others
        serve it, as `legfem.jobs.ranks.leading` has it.
    fresh
        Whether every task has a process of its own, even with one job.
    """

    def __init__(
        self,
        work: Callable[[Context, Task], Outcome],
        context: Context,
        jobs: int = 1,
        comm: MPI.Intracomm = MPI.COMM_SELF,
        fresh: bool = False,
    ) -> None:
        self.work, self.context, self.jobs = work, context, jobs
        self.comm, self.fresh = comm, fresh
        self._executor: ProcessPoolExecutor | None = None

    def __enter__(self) -> Workers[Context, Task, Outcome]:
        """Return itself; processes start with the first several tasks."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the processes; after an error without waiting for the task in hand."""
        if self._executor is None:
            return
        if error is not None:
            for process in list((self._executor._processes or {}).values()):
                process.kill()
        self._executor.shutdown(wait=True, cancel_futures=True)

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
        if self.comm.size > 1:
            yield from over_ranks(self.comm, self.work, self.context, tasks)
        elif not self.fresh and (self.jobs == 1 or (len(tasks) < 2 and self._executor is None)):
            for place, task in enumerate(tasks):
                with interruptible():
                    outcome = self.work(self.context, task)
                yield place, outcome
        else:
            self._executor = self._executor or self._started()
            futures = {self._executor.submit(_work, self.work, t): k for k, t in enumerate(tasks)}
            for future in as_completed(futures):
                yield futures[future], future.result()

    def _started(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            self.jobs,
            mp_context=multiprocessing.get_context("spawn"),
            initializer=_start,
            initargs=(self.context,),
            max_tasks_per_child=1 if self.fresh else None,
        )


# One context a worker process, made when the process starts.
_contexts: list[object] = []


def _start(context: object) -> None:
    # Ctrl-C reaches the whole process group; the parent ends the workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _contexts[:] = [context]


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _work[Task, Outcome](work: Callable[..., Outcome], task: Task) -> Outcome:
    return work(_contexts[0], task)

"""Processes that share one context, made once in each: a mesh, compiled forms."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from types import TracebackType


class Workers[Context, Task, Outcome]:
    """Runs tasks on one or several processes; a context manager, for its processes.

    Parameters
    ----------
    work
        Of a context and a task; a function of a module. Picklable, as are context and tasks, if
        ``jobs`` is over 1.
    context
        Sent to every process once.
    jobs
        Processes; 1 works in this one.
    """

    def __init__(
        self, work: Callable[[Context, Task], Outcome], context: Context, jobs: int
    ) -> None:
        self.work, self.context, self.jobs = work, context, jobs
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
        if self.jobs == 1 or (len(tasks) < 2 and self._executor is None):
            for task in tasks:
                yield task, self.work(self.context, task)
            return
        if self._executor is None:
            self._executor = ProcessPoolExecutor(
                self.jobs,
                mp_context=multiprocessing.get_context("spawn"),
                initializer=_start,
                initargs=(self.context,),
            )
        futures = {self._executor.submit(_work, self.work, task): task for task in tasks}
        for future in as_completed(futures):
            yield futures[future], future.result()


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

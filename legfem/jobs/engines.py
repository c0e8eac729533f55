"""Where many long tasks run: processes, ranks, or a cluster's workers; one that dies costs itself alone.

Every engine is a `concurrent.futures.Executor`; nothing here deals out tasks beyond handing over the next one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import AbstractContextManager
from dataclasses import dataclass

from legfem.jobs.pool import interruptible, processes


@dataclass(frozen=True)
class Died:
    """A task whose process, rank or worker ended, twice."""

    problem: str


type Engine = Callable[[int], AbstractContextManager[Executor]]
"""Gives an executor with a number of workers."""


def local(workers: int) -> AbstractContextManager[Executor]:
    """Processes on this machine; this one, if it is to be one alone."""
    return _Here() if workers == 1 else processes(workers)


class _Here(Executor):
    """Does what it is given at once."""

    def submit[**Given, Outcome](
        self, work: Callable[Given, Outcome], /, *given: Given.args, **named: Given.kwargs
    ) -> Future[Outcome]:
        future: Future[Outcome] = Future()
        with interruptible():
            future.set_result(work(*given, **named))
        return future


def outcomes[Task, Outcome](
    engine: Engine, workers: int, work: Callable[[Task], Outcome], tasks: Sequence[Task]
) -> Iterator[tuple[int, Outcome | Died]]:
    """Yield tasks' places with their outcomes as they become known.

    No more tasks are handed over than workers can begin at once. Where a worker dies, the tasks that were begun are
    suspected: each is tried once more when the others are done, by itself, so that it is known which one it was.

    Parameters
    ----------
    engine
        Where they run.
    workers
        How many at once.
    work
        Function of a task, defined in a module; what it raises is raised here.
    tasks
        Picklable.
    """
    waiting, suspects = list(range(len(tasks)))[::-1], list[int]()
    while waiting:
        begun: dict[Future[Outcome], int] = {}
        with engine(workers) as executor:
            try:
                while waiting or begun:
                    while waiting and len(begun) < workers:
                        place = waiting.pop()
                        begun[executor.submit(work, tasks[place])] = place
                    for future in wait(begun, return_when=FIRST_COMPLETED).done:
                        yield begun[future], future.result()
                        del begun[future]
            except BrokenExecutor:
                suspects += _undone(begun)
                yield from _done(begun)
    for place in suspects:
        with processes(1) as executor:
            try:
                yield place, executor.submit(work, tasks[place]).result()
            except BrokenExecutor:
                yield place, Died("its process was ended from outside twice (out of memory?)")


def _undone[Outcome](begun: dict[Future[Outcome], int]) -> list[int]:
    return [place for future, place in begun.items() if not _succeeded(future)]


def _done[Outcome](begun: dict[Future[Outcome], int]) -> Iterator[tuple[int, Outcome]]:
    for future, place in begun.items():
        if _succeeded(future):
            yield place, future.result()


def _succeeded[Outcome](future: Future[Outcome]) -> bool:
    return future.done() and not future.cancelled() and future.exception() is None

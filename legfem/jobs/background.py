"""One piece of work in a copy of this process, while this one goes on with another."""

from __future__ import annotations

import multiprocessing
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection

_PATIENCE_S = 120.0
"""After which a copy is taken to hang."""

type Result[T] = Callable[[], T]
"""Waits for what a piece of work returns."""


@contextmanager
def in_background[T](work: Callable[[], T], apart: bool = True) -> Iterator[Result[T]]:
    """Begin a piece of work in a forked copy, which shares no later change, and yield its result.

    The copy must leave MPI and PETSc alone. What it can't do is done here once the result is asked
    for, and so is everything where processes can't be forked safely.

    Parameters
    ----------
    work
        Function without arguments; what it returns is picklable.
    apart
        Whether a forked copy may be made.
    """
    if not (apart and sys.platform == "linux"):
        yield work
        return
    fork = multiprocessing.get_context("fork")
    here, there = fork.Pipe(duplex=False)
    copy = fork.Process(target=_work, args=(work, there), daemon=True)
    with warnings.catch_warnings():
        # That other threads' locks stay shut in a copy: those of MPI, which it leaves alone.
        warnings.simplefilter("ignore", DeprecationWarning)
        copy.start()
    there.close()

    def result() -> T:
        try:
            if here.poll(_PATIENCE_S):
                found: T = here.recv()
                return found
        except EOFError:
            pass
        copy.kill()
        copy.join()
        return work()

    try:
        yield result
    finally:
        copy.kill()
        copy.join()
        here.close()


def _work[T](work: Callable[[], T], there: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever made the copy ends it
    with there:
        there.send(work())

"""Who does the simulations: this process, several processes, or the ranks of an MPI job."""

from __future__ import annotations

import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context, parent_process
from typing import Any, Protocol

from legfem.errors import InputError
from legfem.study.doe.simulator import Record, Request, Simulator

_RESULT = 7

Found = tuple[int, Record]
"""A request's place in the list, and what came of it."""


class Runner(Protocol):
    """Does simulations in whatever order; yields each as it is done."""

    def run(self, simulator: Simulator, requests: Sequence[Request]) -> Iterator[Found]:
        """Simulate all requests."""
        ...


class Here:
    """One after the other, in this process."""

    def run(self, simulator: Simulator, requests: Sequence[Request]) -> Iterator[Found]:
        """Simulate all requests."""
        for place, request in enumerate(requests):
            yield place, simulator.simulate(request)


class Processes:
    """Several processes of this machine.

    Parameters
    ----------
    jobs : int
        Their number.
    """

    def __init__(self, jobs: int) -> None:
        self.jobs = jobs

    def run(self, simulator: Simulator, requests: Sequence[Request]) -> Iterator[Found]:
        """Simulate all requests."""
        pool = ProcessPoolExecutor(
            min(self.jobs, max(len(requests), 1)),
            mp_context=get_context("spawn"),
            initializer=_begin,
            initargs=(simulator,),
        )
        try:
            waiting = {pool.submit(_simulate, request): k for k, request in enumerate(requests)}
            for future in as_completed(waiting):
                yield waiting[future], future.result()
        finally:
            # What is queued is dropped, what runs is waited for: a kept run is a whole one.
            pool.shutdown(cancel_futures=True)


_simulator: Simulator | None = None


def _begin(simulator: Simulator) -> None:
    global _simulator
    _simulator = simulator
    # An interrupt from the keyboard reaches all processes: the first one decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_leave_with_parent, daemon=True).start()


def _leave_with_parent() -> None:
    """End this process when the one that started it was killed: nobody takes its results."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _simulate(request: Request) -> Record:
    assert _simulator is not None
    return _simulator.simulate(request)


class Ranks:
    """All ranks of an MPI communicator; the first one also collects.

    Every rank does each ``size``-th request. The first takes in what the others have done between
    its own and, by the simulator's ``on_step``, while it simulates.
    """

    def __init__(self, comm: Any) -> None:
        self.comm = comm

    def run(self, simulator: Simulator, requests: Sequence[Request]) -> Iterator[Found]:
        """Simulate all requests; only the first rank calls this, the others `serve`."""
        self.comm.bcast((simulator, list(requests)))
        arrived: list[Found] = []

        def collect(_: float = 0.0) -> None:
            while self.comm.iprobe(tag=_RESULT):
                arrived.append(self.comm.recv(tag=_RESULT))

        remaining = len(requests)
        for place in range(0, len(requests), self.comm.size):
            arrived.append((place, simulator.simulate(requests[place], collect)))
            collect()
            remaining -= len(arrived)
            yield from arrived
            arrived.clear()
        for _ in range(remaining):
            yield self.comm.recv(tag=_RESULT)

    def serve(self) -> None:
        """Simulate what the first rank asks for until it has no more."""
        simulator: Simulator | None = None
        while (work := self.comm.bcast(None)) is not None:
            given, requests = work
            # The meshes made for the last list stay.
            if simulator is None or simulator.fingerprint() != given.fingerprint():
                simulator = given
            for place in range(self.comm.rank, len(requests), self.comm.size):
                found = place, simulator.simulate(requests[place])
                self.comm.send(found, dest=0, tag=_RESULT)

    def end(self) -> None:
        """Let the other ranks go."""
        self.comm.bcast(None)


def lead(comm: Any, jobs: int, work: Callable[[Runner], None]) -> None:
    """Do work with all there is; under MPI the other ranks serve the first."""
    if comm.size == 1:
        work(Here() if jobs == 1 else Processes(jobs))
        return
    ranks = Ranks(comm)
    if comm.rank > 0:
        ranks.serve()
        return
    try:
        work(ranks)
    except InputError:
        ranks.end()
        raise
    except BaseException as error:
        # The others may wait to hand in a run: they can't be told any more.
        if isinstance(error, KeyboardInterrupt):
            print("interrupted: run the same command again to go on", file=sys.stderr)
        else:
            traceback.print_exc()
        sys.stderr.flush()
        comm.Abort(130 if isinstance(error, KeyboardInterrupt) else 1)
    ranks.end()

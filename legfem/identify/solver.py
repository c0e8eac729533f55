"""Full solves: kept ones from disk, new ones on one or several processes."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from types import TracebackType

from legfem.identify.forward import DeepTissue, ForwardModel, ForwardOutcome
from legfem.identify.store import SolveStore
from legfem.progress import Progress


class FullSolver:
    """Solves points in full; a context manager, for its processes.

    What it returns doesn't depend on the number of processes, nor on what an earlier run kept.

    Parameters
    ----------
    model : ForwardModel
        Picklable if ``jobs`` is over 1.
    store : SolveStore, optional
        Where every solve is kept as soon as it is done.
    jobs : int
        Processes.
    progress : Progress
        Told of every solve.
    """

    def __init__(
        self, model: ForwardModel, store: SolveStore | None, jobs: int, progress: Progress
    ) -> None:
        self.model, self.store, self.jobs, self.progress = model, store, jobs, progress
        self.reused: set[DeepTissue] = set()
        self._executor: ProcessPoolExecutor | None = None
        self._known: dict[DeepTissue, ForwardOutcome] = {}

    def __enter__(self) -> FullSolver:
        """Return itself; processes start with the first batch of several solves."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the processes; after an error without waiting for the solve in hand."""
        if self._executor is None:
            return
        if error is not None:
            for process in list((self._executor._processes or {}).values()):
                process.kill()
        self._executor.shutdown(wait=True, cancel_futures=True)

    def solve(self, points: Sequence[DeepTissue]) -> list[ForwardOutcome]:
        """Return the outcomes of points, in their order."""
        wanted = [point for point in dict.fromkeys(points) if not self._recall(point)]
        if self.jobs > 1 and (len(wanted) > 1 or self._executor is not None):
            self._solve_in_processes(wanted)
        else:
            for point in wanted:
                self._take(self.model.solve(point))
        return [self._known[point] for point in points]

    def _recall(self, point: DeepTissue) -> bool:
        if point in self._known:
            return True
        outcome = self.store.load(point) if self.store else None
        if outcome is None:
            return False
        self._known[point] = outcome
        self.reused.add(point)
        self._report(outcome, "kept from before")
        return True

    def _solve_in_processes(self, points: Sequence[DeepTissue]) -> None:
        if self._executor is None:
            self._executor = ProcessPoolExecutor(
                self.jobs,
                mp_context=multiprocessing.get_context("spawn"),
                initializer=_start_worker,
                initargs=(self.model,),
            )
        futures: list[Future[ForwardOutcome]] = [
            self._executor.submit(_solve_in_worker, point) for point in points
        ]
        for future in as_completed(futures):
            self._take(future.result())

    def _take(self, outcome: ForwardOutcome) -> None:
        if self.store:
            self.store.keep(outcome)
        self._known[outcome.deep] = outcome
        self._report(outcome, f"{outcome.seconds:.1f} s")

    def _report(self, outcome: ForwardOutcome, how: str) -> None:
        deep = outcome.deep
        end = "" if outcome.complete else f", stopped at {outcome.curve.depth:.1f} mm"
        self.progress.advance(f"C10 {deep.C10:.4g} kPa, C20 {deep.C20:.4g} kPa ({how}{end})")


# One forward model a worker process, made when the process starts.
_models: list[ForwardModel] = []


def _start_worker(model: ForwardModel) -> None:
    # Ctrl-C reaches the whole process group; the parent ends the workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _models[:] = [model]


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _solve_in_worker(point: DeepTissue) -> ForwardOutcome:
    return _models[0].solve(point)

"""Full solves: kept ones from disk, new ones on one or several processes."""

from __future__ import annotations

from collections.abc import Sequence
from types import TracebackType

from legfem.identify.forward import DeepTissue, ForwardModel, ForwardOutcome
from legfem.identify.store import SolveStore
from legfem.progress import Progress
from legfem.workers import Workers


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
        self._workers: Workers[ForwardModel, DeepTissue, ForwardOutcome] = Workers(
            _solve, model, jobs
        )
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
        self._workers.__exit__(kind, error, trace)

    def solve(self, points: Sequence[DeepTissue]) -> list[ForwardOutcome]:
        """Return the outcomes of points, in their order."""
        wanted = [point for point in dict.fromkeys(points) if not self._recall(point)]
        for _, outcome in self._workers.run(wanted):
            self._take(outcome)
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

    def _take(self, outcome: ForwardOutcome) -> None:
        if self.store:
            self.store.keep(outcome)
        self._known[outcome.deep] = outcome
        self._report(outcome, f"{outcome.seconds:.1f} s")

    def _report(self, outcome: ForwardOutcome, how: str) -> None:
        deep = outcome.deep
        end = "" if outcome.complete else f", stopped at {outcome.curve.depth:.1f} mm"
        self.progress.advance(f"C10 {deep.C10:.4g} kPa, C20 {deep.C20:.4g} kPa ({how}{end})")


def _solve(model: ForwardModel, point: DeepTissue) -> ForwardOutcome:
    return model.solve(point)

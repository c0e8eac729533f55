"""Full solves: kept ones from disk, new ones on one or several processes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from legfem.common.progress import Progress
from legfem.identify.catalogue import Values, stiffness_in_words
from legfem.identify.forward import ForwardModel, ForwardOutcome
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store

type Key = frozenset[tuple[str, float]]


class FullSolver:
    """Solves points in full; a context manager, for its processes.

    What it returns doesn't depend on the number of processes, nor on what an earlier run kept.

    Parameters
    ----------
    model : ForwardModel
        Picklable if ``jobs`` is over 1.
    store : Store, optional
        Where every solve is kept as soon as it is done.
    jobs : int
        Processes.
    progress : Progress
        Told of every solve.
    sensitivities : tuple of str
        The model's parameters that every solve differentiates the force by.
    """

    def __init__(
        self,
        model: ForwardModel,
        store: Store[ForwardOutcome] | None,
        jobs: int,
        progress: Progress,
        sensitivities: tuple[str, ...],
    ) -> None:
        self.model, self.store, self.jobs, self.progress = model, store, jobs, progress
        self.sensitivities = sensitivities
        self.reused: set[Key] = set()
        self._workers: Workers[ForwardModel, _Task, ForwardOutcome] = Workers(_solve, model, jobs, along=True)
        self._known: dict[Key, ForwardOutcome] = {}

    def __enter__(self) -> FullSolver:
        """Return itself; processes start with the first batch of several solves."""
        return self

    def __exit__(self, *raised: Any) -> None:
        """End the processes; after an error without waiting for the solve in hand."""
        self._workers.__exit__(*raised)

    def start(self, ready: Callable[[Any], None], most: int) -> None:
        """Start up to ``most`` other processes, and get the model ready in each meanwhile."""
        self._workers.start(ready, most)

    def solve(self, points: Sequence[Values]) -> list[ForwardOutcome]:
        """Return the outcomes of the model's values, in their order."""
        distinct = {key_of_values(values): values for values in points}
        wanted = [values for key, values in distinct.items() if not self._recall(key, values)]
        tasks = [(dict(values), self.sensitivities) for values in wanted]
        for _, outcome in self._workers.run(tasks):
            self._take(outcome)
        return [self._known[key_of_values(values)] for values in points]

    def was_reused(self, values: Values) -> bool:
        """Return whether an earlier run had kept a solve."""
        return key_of_values(values) in self.reused

    def _recall(self, key: Key, values: Values) -> bool:
        if key in self._known:
            return True
        outcome = self.store.get((values, self.sensitivities)) if self.store else None
        if outcome is None:
            return False
        self._known[key] = outcome
        self.reused.add(key)
        self._report(outcome, "kept from before")
        return True

    def _take(self, outcome: ForwardOutcome) -> None:
        if self.store:
            self.store.put((outcome.values, self.sensitivities), outcome)
        self._known[key_of_values(outcome.values)] = outcome
        self._report(outcome, f"{outcome.seconds:.1f} s")

    def _report(self, outcome: ForwardOutcome, how: str) -> None:
        reached = ", ".join(f"{curve.depth:.1f}" for curve in outcome.curves)
        end = "" if outcome.complete else f", stopped at {reached} mm"
        self.progress.advance(f"{stiffness_in_words(outcome.values)} ({how}{end})")


type _Task = tuple[Values, tuple[str, ...]]


def key_of_values(values: Values) -> Key:
    """Return what two equal sets of values have in common."""
    return frozenset(values.items())


def _solve(model: ForwardModel, task: _Task) -> ForwardOutcome:
    return model.solve(*task)

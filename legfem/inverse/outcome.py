"""The seam to a forward model: values in, curves or a failure out; kept solves, processes, the chain rule."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from legfem.common.progress import Progress
from legfem.common.units import FloatArray
from legfem.inverse.catalogue import Values, stiffness_in_words
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store
from legfem.solve.path import ForceCurve, Path, SolveReport


@dataclass(frozen=True, eq=False)
class StateField:
    """A quantity at points of the body in the last state of a solve."""

    values: FloatArray
    """Displacements (mm) or pressures (MPa), of any shape."""
    sensitivities: Mapping[str, FloatArray] = field(default_factory=dict)
    """Derivatives by parameters, by full name, per unit of the parameter; each of the values' shape."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """One full solve, whether it reached its depth or not."""

    values: Values
    """Values of the model, as asked for."""
    curves: tuple[ForceCurve, ...]
    """One a test that is solved together: a leg has one. With the derivatives that were asked for,
    in N per unit of the parameter; they end where the solve did."""
    complete: bool
    reason: str
    """Why it ended."""
    factorisations: int
    seconds: float
    compromise: str = ""
    """What the model gave up to go on, in words; empty if nothing."""
    contact_stiffness_factor: float = 1.0
    """Factor on the contact's stiffness; below 1 where it had to be softened to go on."""
    fields: Mapping[str, StateField] = field(default_factory=dict)
    """What is seen of the last state, by name, where that and no curve is compared."""

    @classmethod
    def of(cls, values: Values, curve: ForceCurve, report: SolveReport) -> "Outcome":
        """Return the outcome of one test by its curve, with the derivatives asked for, and its solve's report."""
        return cls(
            values,
            (curve,),
            bool(report.complete),
            report.reason,
            report.factorisations,
            float(report.seconds) + sum(before.seconds for before in report.earlier_attempts),
            report.compromise,
            report.contact_stiffness_factor,
        )

    @classmethod
    def joined(cls, values: Values, every: Sequence["Outcome"]) -> "Outcome":
        """Return one outcome of several tests, each solved by itself with the same values."""
        return cls(
            values,
            tuple(one.curve for one in every),
            all(one.complete for one in every),
            "; ".join(one.reason for one in every if not one.complete),
            sum(one.factorisations for one in every),
            sum(one.seconds for one in every),
            "; ".join(dict.fromkeys(one.compromise for one in every if one.compromise)),
            min(one.contact_stiffness_factor for one in every),
        )

    @property
    def reached(self) -> float:
        """Displacement (mm) that every test came to; 0 without any curve."""
        return min((curve.depth for curve in self.curves), default=0.0)

    @property
    def curve(self) -> ForceCurve:
        """Curve of the only test."""
        (only,) = self.curves
        return only


class Forward(Protocol):
    """What identification needs of a model; it must be picklable for several processes."""

    @property
    def nominal(self) -> Values:
        """All values of the model as assumed, by full name."""
        ...

    def prepare(self) -> None:
        """Mesh and compile now."""
        ...

    def solve(self, values: Values, sensitivities: Sequence[str]) -> Outcome:
        """Solve in full; stopping short of the depth is an outcome, not an exception."""
        ...

    def fingerprint(self) -> Mapping[str, Any]:
        """Return all that a solve depends on but the values, as JSON types."""
        ...


type Key = frozenset[tuple[str, float]]


class FullSolver:
    """Solves points in full; a context manager, for its processes.

    What it returns doesn't depend on the number of processes, nor on what an earlier run kept.

    Parameters
    ----------
    model : Forward
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
        model: Forward,
        store: Store[Outcome] | None,
        jobs: int,
        progress: Progress,
        sensitivities: tuple[str, ...],
    ) -> None:
        self.model, self.store, self.jobs, self.progress = model, store, jobs, progress
        self.sensitivities = sensitivities
        self.reused: set[Key] = set()
        self._workers: Workers[Forward, _Task, Outcome] = Workers(_solve, model, jobs, along=True)
        self._known: dict[Key, Outcome] = {}

    def __enter__(self) -> "FullSolver":
        """Return itself; processes start with the first batch of several solves."""
        return self

    def __exit__(self, *raised: Any) -> None:
        """End the processes; after an error without waiting for the solve in hand."""
        self._workers.__exit__(*raised)

    def start(self, ready: Callable[[Any], None], most: int) -> None:
        """Start up to ``most`` other processes, and get the model ready in each meanwhile."""
        self._workers.start(ready, most)

    def solve(self, points: Sequence[Values]) -> list[Outcome]:
        """Return the outcomes of the model's values, in their order."""
        distinct = {key_of_values(values): values for values in points}
        wanted = [values for key, values in distinct.items() if not self._recall(key, values)]
        tasks = [(dict(values), self.sensitivities) for values in wanted]
        for _, outcome in self._workers.run(tasks):
            if self.store:
                self.store.put((outcome.values, self.sensitivities), outcome)
            self._known[key_of_values(outcome.values)] = outcome
            self._report(outcome, f"{outcome.seconds:.1f} s")
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

    def _report(self, outcome: Outcome, how: str) -> None:
        reached = ", ".join(f"{curve.depth:.1f}" for curve in outcome.curves)
        where = f"stopped at {reached} mm" if reached else f"no state found: {outcome.reason}"
        end = "" if outcome.complete else f", {where}"
        self.progress.advance(f"{stiffness_in_words(outcome.values)} ({how}{end})")


type _Task = tuple[Values, tuple[str, ...]]


def key_of_values(values: Values) -> Key:
    """Return what two equal sets of values have in common."""
    return frozenset(values.items())


def _solve(model: Forward, task: _Task) -> Outcome:
    return model.solve(*task)


@dataclass(eq=False)
class JointForward[Model: Forward]:
    """Sites of the same tissues, a `legfem.inverse.outcome.Forward`.

    Parameters
    ----------
    models : tuple of Forward
        One a site, each pressed as deep as its recordings go.
    workers : Workers, optional
        Processes that run `solve_test` on the same models, sites side by side. One site
        after another without them.
    """

    models: tuple[Model, ...]
    workers: Workers[tuple[Model, ...], "TestTask", Outcome] | None = None

    @property
    def nominal(self) -> Values:
        """The tissues' values, which are the same at all sites (MPa, 1/MPa)."""
        return self.models[0].nominal

    def prepare(self) -> None:
        """Compile and mesh now."""
        for model in self.models:
            model.prepare()

    def solve(self, values: Values, sensitivities: Sequence[str]) -> Outcome:
        """Solve every site in full."""
        tasks = [(number, values, sensitivities) for number in range(len(self.models))]
        if self.workers is None:
            every = [solve_test(self.models, task) for task in tasks]
        else:
            every = list(self.workers.in_order(tasks))
        return Outcome.joined(values, every)

    def fingerprint(self) -> Mapping[str, Any]:
        """Return what the sites' solves depend on."""
        return {"model": "sites", "sites": [model.fingerprint() for model in self.models]}


type TestTask = tuple[int, Values, Sequence[str]]
"""A site's number, the tissues' values, and what its solve is differentiated by."""


def solve_test[Model: Forward](models: Sequence[Model], task: TestTask) -> Outcome:
    """Solve one of several sites in full."""
    number, values, sensitivities = task
    return models[number].solve(values, sensitivities)


type Chain = Mapping[str, Mapping[str, float]]
"""Derivatives of the model's own parameters by each parameter that is asked for; full names."""


def needed_for(chain: Chain) -> tuple[str, ...]:
    """Return the model's own parameters by which it has to be differentiated."""
    return tuple(dict.fromkeys(name for row in chain.values() for name in row))


def through[Course: (ForceCurve, Path)](chain: Chain, curve: Course) -> Course:
    """Return a curve or path with derivatives by what is asked for, of one with those of `needed_for`."""

    def summed(by: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        nothing = np.zeros_like(curve.displacement)
        return {
            asked: np.asarray(sum((weight * by[name] for name, weight in row.items()), nothing))
            for asked, row in chain.items()
        }

    channels = {name: summed(by) for name, by in curve.channel_sensitivities.items()}
    return replace(curve, sensitivities=summed(curve.sensitivities), channel_sensitivities=channels)

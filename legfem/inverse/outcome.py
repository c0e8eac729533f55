"""The seam to a forward model: values in, curves or a failure out; kept solves, processes, the chain rule."""

import pathlib
from collections.abc import Mapping, Sequence
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

    def prepare(self) -> None:
        """Mesh and compile now."""

    def solve(self, values: Values, sensitivities: Sequence[str]) -> Outcome:
        """Solve in full; stopping short of the depth is an outcome, not an exception."""

    def fingerprint(self) -> Mapping[str, Any]:
        """Return all that a solve depends on but the values, as JSON types."""


@dataclass(eq=False)
class JointForward[Model: Forward]:
    """Tests of the same tissues, a `legfem.inverse.outcome.Forward`.

    Parameters
    ----------
    models : tuple of Forward
        One a test, each pressed as deep as its recordings go.
    """

    models: tuple[Model, ...]

    @property
    def nominal(self) -> Values:
        """The tissues' values, which are the same in all tests (MPa, 1/MPa)."""
        return self.models[0].nominal

    def prepare(self) -> None:
        """Compile and mesh now."""
        for model in self.models:
            model.prepare()

    def solve(self, values: Values, sensitivities: Sequence[str]) -> Outcome:
        """Solve every test in full."""
        return Outcome.joined(values, [model.solve(values, sensitivities) for model in self.models])

    def fingerprint(self) -> Mapping[str, Any]:
        """Return what the tests' solves depend on."""
        return {"model": "sites", "sites": [model.fingerprint() for model in self.models]}


type TestTask = tuple[int, Values, Sequence[str]]
"""A test's number, the tissues' values, and what its solve is differentiated by."""


def solve_test[Model: Forward](models: Sequence[Model], task: TestTask) -> Outcome:
    """Solve one of several tests in full."""
    number, values, sensitivities = task
    return models[number].solve(values, sensitivities)


type Key = frozenset[tuple[str, float]]


class FullSolver:
    """Solves points in full; a context manager, for its processes.

    Each test of a `JointForward` is solved by itself, in whichever process is free, and kept as soon as it is done.
    What is returned doesn't depend on the number of processes, nor on what an earlier run kept.

    Parameters
    ----------
    model : Forward
        Picklable if ``jobs`` is over 1.
    kept : Path, optional
        Folder in which solves are kept.
    jobs : int
        Processes.
    progress : Progress
        Told of every point.
    sensitivities : tuple of str
        The model's parameters that every solve differentiates the force by.
    """

    def __init__(
        self, model: Forward, kept: pathlib.Path | None, jobs: int, progress: Progress, sensitivities: tuple[str, ...]
    ) -> None:
        self.model, self.progress, self.sensitivities = model, progress, sensitivities
        self.reused: set[Key] = set()
        models = model.models if isinstance(model, JointForward) else (model,)
        self._stores = [None if kept is None else Store(kept, Outcome, one.fingerprint()) for one in models]
        self._workers: Workers[tuple[Forward, ...], TestTask, Outcome] = Workers(solve_test, models, jobs, along=True)
        self._known: dict[Key, Outcome] = {}

    def __enter__(self) -> "FullSolver":
        """Return itself; processes start with the first batch of several solves."""
        return self

    def __exit__(self, *raised: Any) -> None:
        """End the processes; after an error without waiting for the solve in hand."""
        self._workers.__exit__(*raised)

    def start(self, most: int) -> None:
        """Start up to ``most`` other processes, which mesh and compile meanwhile."""
        self._workers.start(_prepared, most)

    def solve(self, points: Sequence[Values]) -> list[Outcome]:
        """Return the outcomes of the model's values, in their order."""
        wanted = {key: values for values in points if (key := key_of_values(values)) not in self._known}
        parts = {key: self._recalled(values) for key, values in wanted.items()}
        for key, found in parts.items():
            if len(found) == len(self._stores):
                self.reused.add(key)
                self._take(wanted[key], found, "kept from before")
        tasks = [
            (number, dict(values), self.sensitivities)
            for key, values in wanted.items()
            for number in range(len(self._stores))
            if number not in parts[key]
        ]
        for (number, values, _), outcome in self._workers.run(tasks):
            if store := self._stores[number]:
                store.put((values, self.sensitivities), outcome)
            found = parts[key_of_values(values)]
            found[number] = outcome
            if len(found) == len(self._stores):
                self._take(values, found, "")
        return [self._known[key_of_values(values)] for values in points]

    def _recalled(self, values: Values) -> dict[int, Outcome]:
        """Return what is kept of a point, by the number of the test."""
        each = enumerate(store.get((values, self.sensitivities)) if store else None for store in self._stores)
        return {number: outcome for number, outcome in each if outcome is not None}

    def _take(self, values: Values, parts: Mapping[int, Outcome], how: str) -> None:
        """Join the outcomes of a point's tests, and tell of it."""
        every = [parts[number] for number in sorted(parts)]
        outcome = Outcome.joined(values, every) if isinstance(self.model, JointForward) else every[0]
        self._known[key_of_values(values)] = outcome
        reached = ", ".join(f"{curve.depth:.1f}" for curve in outcome.curves)
        where = f"stopped at {reached} mm" if reached else f"no state found: {outcome.reason}"
        end = "" if outcome.complete else f", {where}"
        how = how or f"{outcome.seconds:.1f} s"
        self.progress.advance(f"{stiffness_in_words(outcome.values)} ({how}{end})")


def key_of_values(values: Values) -> Key:
    """Return what two equal sets of values have in common."""
    return frozenset(values.items())


def _prepared(models: Sequence[Forward]) -> None:
    for model in models:
        model.prepare()


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

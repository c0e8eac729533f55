"""The library of a leg's responses: solved once, used by every diagnosis on that leg.

Elastic curves stand at a table of stiffnesses with their exact derivatives; what a mechanism adds,
over the elastic force, at a smaller table for each protocol. Between, smooth functions of the
stiffness stand in for the finite elements, and a full solution confirms what is reported.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from legfem.correction import TabulatedCorrection
from legfem.diagnose.mechanisms import (
    MECHANISMS,
    EndEffects,
    Mechanism,
    TissueMechanism,
    Values,
    Viscoelasticity,
)
from legfem.diagnose.observations import Observations
from legfem.diagnose.solved import SolvedResponses, end_effect
from legfem.diagnose.stations import Stations
from legfem.identify.emulator import Emulator, Samples
from legfem.progress import Progress
from legfem.units import FloatArray
from legfem.workers import Workers

C10_KPA = (0.28, 2.8)
STIFFENING = (0.0, 1.6)
"""Range of ln(1 + C20 / C10)."""
ELASTIC_POINTS = (5, 3)
"""Of the elastic table, along ln C10 and ln(1 + C20 / C10)."""
ELASTIC_CHANGE_POINTS = (3, 3)
"""Of the tables of mechanisms that displacement alone tells of."""
PATH_CHANGE_POINTS = (2, 2)
"""Of the tables of mechanisms with time or history."""

type Point = tuple[float, float]


def table_points(shape: tuple[int, int], inset: float = 0.0) -> list[Point]:
    """Return stiffnesses (C10, C20) in kPa on a lattice, drawn in from the range's ends."""
    if shape == (1, 1):
        middle = float(np.sqrt(C10_KPA[0] * C10_KPA[1]))
        return [(middle, float(middle * np.expm1(np.mean(STIFFENING))))]
    ends = np.log(C10_KPA)
    away = inset * (ends[1] - ends[0])
    first = np.exp(np.linspace(ends[0] + away, ends[1] - away, shape[0]))
    away = inset * (STIFFENING[1] - STIFFENING[0])
    second = np.linspace(STIFFENING[0] + away, STIFFENING[1] - away, shape[1])
    return [(float(c), float(c * np.expm1(q))) for c in first for q in second]


@dataclass(frozen=True, eq=False)
class Table:
    """Values at some stiffnesses, and a polynomial in ln C10 and ln(1 + C20 / C10) between."""

    points: Sequence[Point]
    values: FloatArray
    """(points, ...)."""

    @cached_property
    def _coefficients(self) -> FloatArray:
        design = np.array([self._terms(*point) for point in self.points])
        flat = self.values.reshape(len(self.points), -1)
        return np.asarray(np.linalg.lstsq(design, flat, rcond=None)[0])

    def _terms(self, c10: float, c20: float) -> FloatArray:
        x, q = np.log(c10), np.log1p(c20 / c10)
        if len(self.points) < 4:
            return np.ones(1)
        terms = [1.0, x, q, x * q]
        if len(self.points) > 8:
            terms += [x * x, q * q, x * x * q, x * q * q]
        return np.array(terms)

    def __call__(self, c10: float, c20: float) -> FloatArray:
        """Return the values (...) at stiffnesses in kPa."""
        found = self._terms(c10, c20) @ self._coefficients
        return np.asarray(found).reshape(self.values.shape[1:])


@dataclass(frozen=True, eq=False)
class Library:
    """Responses from tables; see `Responses` for the methods' meaning."""

    grid: FloatArray
    elastic: Emulator
    changes: Mapping[tuple[str, str], Table]
    """Along a path: relative changes by mechanism and protocol, (points, shapes or strengths,
    stations); else logarithms of the forces' ratio by mechanism, (points, strengths, grid)."""
    correction: TabulatedCorrection | None = None
    missing: Mapping[str, str] = field(default_factory=dict)
    """Mechanisms that have no table, and why."""
    c10_bounds: tuple[float, float] = (0.6 * C10_KPA[0], 1.6 * C10_KPA[1])
    c20_bounds: tuple[float, float] = (0.0, 15.0)

    def curve(self, c10: float, c20: float) -> FloatArray:
        """Return the elastic force at the grid, N."""
        return self.elastic(c10, c20)

    def relative_change(
        self,
        mechanism: TissueMechanism,
        values: Values,
        c10: float,
        c20: float,
        observed: Observations,
    ) -> FloatArray:
        """Return what a mechanism adds to the elastic force, over that force; (n,)."""
        if isinstance(mechanism, EndEffects):
            return end_effect(self.correction, values, c10, c20, observed)
        if not mechanism.along_path:
            change = self._tabulated(mechanism, values, self.changes[mechanism.name, ""](c10, c20))
            return np.asarray(
                CubicSpline(self.grid, change)(np.maximum(observed.displacement, self.grid[0]))
            )
        return observed.spread(
            [
                self._tabulated(mechanism, values, self.changes[mechanism.name, s.key](c10, c20))
                for s in observed.protocols
            ]
        )

    def _tabulated(
        self, mechanism: TissueMechanism, values: Values, table: FloatArray
    ) -> FloatArray:
        strength = values[mechanism.parameters[0].name]
        if isinstance(mechanism, Viscoelasticity):
            logs = np.log(mechanism.TIMES_S)
            at = np.clip(np.log(values["relaxation_time"]), logs[0] - 0.7, logs[-1] + 0.7)
            return strength * CubicSpline(logs, table, bc_type="natural")(at)
        nodes = _coordinate(mechanism, np.array([0.0, *mechanism.strengths]))
        at = float(_coordinate(mechanism, np.array(strength)))
        rows = np.vstack([np.zeros(table.shape[1]), table])
        order = np.argsort(nodes)
        inside = float(np.clip(at, nodes.min(), nodes.max()))
        found = PchipInterpolator(nodes[order], rows[order])(inside)
        if inside != at and inside != 0.0:
            found = found * at / inside
        return np.asarray(found if mechanism.along_path else np.expm1(found))


def _coordinate(mechanism: TissueMechanism, strength: FloatArray) -> FloatArray:
    """Return what responses are smooth in: the logarithm of a stiffness, else the strength."""
    return np.asarray(np.log1p(strength) if mechanism.proportional else strength)


@dataclass(frozen=True)
class _Task:
    """One entry of the library."""

    kind: str
    """``elastic``, ``change`` or ``relaxation``."""
    point: Point
    mechanism: TissueMechanism | None = None
    strength: float = 0.0
    stations: Stations | None = None


def _work(
    responses: tuple[SolvedResponses, SolvedResponses], task: _Task
) -> Mapping[str, FloatArray] | None:
    """Return an entry; None where its solution stopped."""
    found = _solved(*responses, task)
    return None if any(np.isnan(values).any() for values in found.values()) else found


def _solved(
    solved: SolvedResponses, coarse: SolvedResponses, task: _Task
) -> Mapping[str, FloatArray]:
    if task.kind == "elastic":
        return solved.elastic(*task.point)
    assert task.mechanism is not None
    solution = task.mechanism.solution({p.name: task.strength for p in task.mechanism.parameters})
    if task.stations is None:
        return {"change": coarse.elastic_change(solution, *task.point)}
    if task.kind == "relaxation":
        return coarse.relaxation(task.stations, *task.point)
    return {"change": coarse.path_change(solution, task.stations, *task.point)}


def shown_mechanisms(
    observed: Observations, correction: TabulatedCorrection | None
) -> tuple[list[Mechanism], dict[str, str]]:
    """Return the mechanisms that recordings can show, and why the others can't be."""
    able: list[Mechanism] = []
    unable: dict[str, str] = {}
    for mechanism in MECHANISMS:
        why = mechanism.untestable(observed)
        if why is None and isinstance(mechanism, EndEffects) and correction is None:
            why = "there is no 3D correction for this leg"
        if why is None:
            able.append(mechanism)
        else:
            unable[mechanism.name] = why
    return able, unable


def tested_mechanisms(
    observed: Observations, library: Library
) -> tuple[list[Mechanism], dict[str, str]]:
    """Return the mechanisms to test with a library, and why the others aren't."""
    able, unable = shown_mechanisms(observed, library.correction)
    return [m for m in able if m.name not in library.missing], {**unable, **library.missing}


def build_library(
    solved: SolvedResponses,
    coarse: SolvedResponses,
    observed: Observations,
    mechanisms: Sequence[Mechanism],
    correction: TabulatedCorrection | None,
    jobs: int,
    progress: Progress,
) -> Library:
    """Solve what isn't kept yet, in processes, and return the library for recordings.

    Parameters
    ----------
    solved
        The leg's responses on the mesh that is reported on: elastic curves.
    coarse
        On a coarser one: relative changes, in which most of a mesh's error cancels.
    observed
        The recordings, for their protocols.
    mechanisms
        Those that are to be tabulated.
    correction
        Of 3D effects.
    jobs
        Processes.
    progress
        Told of every solution.
    """
    tissue = [
        m for m in mechanisms if isinstance(m, TissueMechanism) and not isinstance(m, EndEffects)
    ]
    tasks = _tasks(observed, tissue)
    progress.stage("the leg's library of responses", len(tasks))
    found: dict[int, Mapping[str, FloatArray] | None] = {}
    numbers = {id(task): k for k, task in enumerate(tasks)}
    with Workers(_work, (solved, coarse), jobs) as workers:
        for task, outcome in workers.run(tasks):
            found[numbers[id(task)]] = outcome
            progress.advance(_line(task, outcome))
    return _assembled(
        solved, observed, tissue, tasks, [found[k] for k in range(len(tasks))], correction
    )


def _tasks(observed: Observations, tissue: Sequence[TissueMechanism]) -> list[_Task]:
    tasks = [_Task("elastic", point) for point in table_points(ELASTIC_POINTS)]
    for mechanism in tissue:
        where = observed.protocols if mechanism.along_path else (None,)
        for stations in where:
            for point in _change_points(mechanism):
                if isinstance(mechanism, Viscoelasticity):
                    # One solution tells of both tissues.
                    if mechanism.region == "deep":
                        tasks.append(_Task("relaxation", point, mechanism, 0.0, stations))
                    continue
                tasks += [
                    _Task("change", point, mechanism, strength, stations)
                    for strength in mechanism.strengths
                ]
    return tasks


def _change_points(mechanism: TissueMechanism) -> list[Point]:
    if mechanism.costly:
        return table_points((1, 1))
    if mechanism.along_path:
        return table_points(PATH_CHANGE_POINTS, 0.15)
    return table_points(ELASTIC_CHANGE_POINTS)


def _line(task: _Task, outcome: Mapping[str, FloatArray] | None) -> str:
    what = "elastic" if task.mechanism is None else task.mechanism.name
    at = "" if task.stations is None else f", {task.stations.label}"
    end = "" if outcome is not None else ": STOPPED"
    return f"{what}{at} at C10 {task.point[0]:.3g}, C20 {task.point[1]:.3g} kPa{end}"


def _assembled(
    solved: SolvedResponses,
    observed: Observations,
    tissue: Sequence[TissueMechanism],
    tasks: Sequence[_Task],
    outcomes: Sequence[Mapping[str, FloatArray] | None],
    correction: TabulatedCorrection | None,
) -> Library:
    elastic = [
        (task.point, outcome)
        for task, outcome in zip(tasks, outcomes, strict=True)
        if task.kind == "elastic" and outcome is not None
    ]
    points = [point for point, _ in elastic]

    def column(name: str) -> FloatArray:
        return np.array([outcome[name] for _, outcome in elastic])

    c10, c20 = (np.array(values) for values in zip(*points, strict=True))
    force = column("force")
    samples = Samples(c10, c20, force, column("deep.C10") / 1e3, column("deep.C20") / 1e3)
    missing: dict[str, str] = {}
    changes: dict[tuple[str, str], Table] = {}
    for mechanism in tissue:
        keys = [s.key for s in observed.protocols] if mechanism.along_path else [""]
        for key in keys:
            table = _change_table(mechanism, key, tasks, outcomes)
            if table is None:
                missing[mechanism.name] = "its solutions did not follow the protocol to the end"
            else:
                changes[mechanism.name, key] = table
    return Library(solved.grid, Emulator(samples, 2), changes, correction, missing)


def _change_table(
    mechanism: TissueMechanism,
    key: str,
    tasks: Sequence[_Task],
    outcomes: Sequence[Mapping[str, FloatArray] | None],
) -> Table | None:
    region = mechanism.region if isinstance(mechanism, Viscoelasticity) else None
    rows: dict[Point, list[FloatArray | None]] = {}
    for task, outcome in zip(tasks, outcomes, strict=True):
        if task.kind == "elastic" or ("" if task.stations is None else task.stations.key) != key:
            continue
        if region is not None and task.kind == "relaxation":
            rows[task.point] = [None if outcome is None else outcome[region]]
        elif region is None and task.mechanism is mechanism:
            row = None if outcome is None else outcome["change"]
            rows.setdefault(task.point, []).append(row)
    whole = {p: np.vstack(r) for p, r in rows.items() if all(v is not None for v in r)}  # type: ignore[arg-type]
    if len(whole) < len(rows) or not rows:
        return None
    values = np.array(list(whole.values()))
    return Table(list(whole), values if mechanism.along_path else np.log1p(values))

"""Building a body's library of responses: the tasks, their solutions in processes, and the tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline, make_smoothing_spline

from legfem.common.progress import Progress
from legfem.common.units import FloatArray
from legfem.data.segmentation import LOADING
from legfem.inverse.emulator import Emulator, Samples
from legfem.inverse.library import Library, NuisanceChanges, Table, coordinates, unchanged
from legfem.inverse.mechanism import Mechanism, Stiffness, TissueMechanism, Values, null_of
from legfem.inverse.observations import Observations
from legfem.inverse.responses import BodyModels, Displaced, NotKeptError, SolvedResponses
from legfem.inverse.stations import Stations
from legfem.jobs.pool import Workers

LATTICE = (-0.7, 0.0, 0.7)
"""Logarithms of C10 over the middle's."""
CHANGES_AT = (-0.35, 0.35)
"""Logarithms of C10 over the middle's, at which changes are tabulated."""


@dataclass(frozen=True)
class Task:
    """One entry of the library."""

    point: Stiffness
    mechanism: TissueMechanism | None = None
    strength: float = 0.0
    node: Values | None = None
    stations: Stations | None = None
    geometry: Displaced | None = None
    material: bool = False

    @property
    def label(self) -> str:
        """What progress says."""
        what = "elastic"
        if self.mechanism is not None:
            what = self.mechanism.name
        elif self.geometry is not None:
            what = self.geometry.name
        elif self.material:
            what = "derivatives by what is assumed"
        at = "" if self.stations is None else f", {self.stations.label}"
        return f"{what}{at} at C10 {self.point[0]:.3g}, C20 {self.point[1]:.3g} kPa"


def _work(responses: tuple[SolvedResponses, SolvedResponses], task: Task) -> Mapping[str, FloatArray] | None:
    """Return an entry; None where its solution stopped."""
    found = _solved(*responses, task)
    return None if any(np.isnan(values).any() for values in found.values()) else found


def _solved(solved: SolvedResponses, coarse: SolvedResponses, task: Task) -> Mapping[str, FloatArray]:
    if task.geometry is not None:
        own = task.geometry
        return {"change": coarse.displaced(own.moved, own.placement, task.point)}
    if task.material:
        return coarse.sensitivities(coarse.variants.assumed, task.point)
    mechanism = task.mechanism
    if mechanism is None:
        return solved.elastic(task.point)
    if task.node is not None:
        return {"change": coarse.elastic_change(mechanism.solution(task.node), task.point)}
    if mechanism.derivatives:
        return {"change": coarse.by_derivatives(mechanism, task.stations, task.point)}
    values = {p.name: null_of(p) for p in mechanism.parameters}
    solution = mechanism.solution({**values, mechanism.parameters[0].name: task.strength})
    if task.stations is None:
        return {"change": coarse.elastic_change(solution, task.point)}
    return {"change": coarse.path_change(solution, task.stations, task.point)}


def tasks_for(
    observed: Observations,
    tissue: Sequence[TissueMechanism],
    middle: float,
    stiffening: float,
    models: BodyModels,
    stiffenings: Sequence[float],
) -> list[Task]:
    """Return what a library is solved of: at a middle C10 (kPa) and about it.

    ``stiffening`` is ln(1 + C20 / C10) where changes are tabulated, ``stiffenings`` those of the
    elastic curves.
    """

    def point(log: float, q: float) -> Stiffness:
        c10 = middle * float(np.exp(log))
        return c10, c10 * float(np.expm1(q))

    where = [point(log, stiffening) for log in CHANGES_AT]
    centre = point(0.0, stiffening)
    # What takes longest comes first, which keeps all processes busy to the end.
    along = [m for m in tissue if m.along_path]
    tasks = [
        Task(centre, m, strength, stations)
        for m in along
        for stations in observed.protocols
        for strength in (m.strengths or (0.0,))
    ]
    tasks += [Task(point(log, q)) for log in LATTICE for q in stiffenings]
    tasks.append(Task(centre, material=True))
    tasks += [Task(centre, geometry=geometry) for geometry in models.displaced]
    tasks += [
        Task(at, m, strength)
        for m in tissue
        if not m.along_path
        for at in (where if m.strengths else [centre])
        for strength in (m.strengths or (0.0,))
    ]
    return tasks + [Task(centre, m, node=node) for m in tissue if not m.along_path for node in m.nodes]


def outcomes_of(
    responses: tuple[SolvedResponses, SolvedResponses], tasks: Sequence[Task], jobs: int, progress: Progress
) -> dict[int, Mapping[str, FloatArray] | None]:
    """Return tasks' outcomes by their places; processes are started for what isn't kept only."""
    found: dict[int, Mapping[str, FloatArray] | None] = {}
    kept = responses[0].recalling(), responses[1].recalling()
    missing: list[int] = []

    def tell(place: int) -> None:
        progress.advance(tasks[place].label + ("" if found[place] is not None else ": STOPPED"))

    for place, task in enumerate(tasks):
        try:
            found[place] = _work(kept, task)
        except NotKeptError:
            missing.append(place)
        else:
            tell(place)
    with Workers(_work, responses, jobs) as workers:
        for number, outcome in workers.places([tasks[place] for place in missing]):
            found[missing[number]] = outcome
            tell(missing[number])
    return found


STIFFENINGS = (0.0, 0.8, 1.6)
"""ln(1 + C20 / C10) of the lattice."""
_ROUND = 0.25
"""Of the middle's ln C10; and of where its stiffening is looked up."""
_FIRST_C10_KPA = 0.8
_SMOOTH = 3e-3
"""Penalty of the squared second derivative by the logarithm of the way: at 5 mm waves of less than
3 mm go."""
_WIGGLE = 0.1
"""Of the largest change: the most that a wiggle may be."""
_FEWEST = 5
"""Points of a curve that can be smoothed."""


def middle_of(observed: Observations, coarse: SolvedResponses, stiffening: float) -> float:
    """Return the C10 (kPa, of a round logarithm) at which the loading is about as recorded.

    Parameters
    ----------
    observed
        The recordings.
    coarse
        Responses by full solutions.
    stiffening
        ln(1 + C20 / C10) there.
    """
    loading = observed.phase == LOADING
    d, force = observed.displacement[loading], observed.force[loading]
    log = np.log(_FIRST_C10_KPA)
    for _ in range(5):
        c10 = float(np.exp(log))
        curve = coarse.curve(c10, c10 * float(np.expm1(stiffening)))
        if np.isnan(curve).any():
            log += 0.7
            continue
        grid = np.concatenate([[0.0], coarse.grid])
        there = CubicSpline(grid, np.concatenate([[0.0], curve]))(np.maximum(d, 0.0))
        ratio = float(force @ there) / float(there @ there)
        step = float(np.clip(np.log(max(ratio, 1e-3)) / 0.7, -1.5, 1.5))
        log += step
        if abs(step) < 0.5 * _ROUND:
            break
    return rounded(float(np.exp(log)))


def rounded(c10: float) -> float:
    """Return a stiffness (kPa) of a round logarithm near one."""
    return float(np.exp(_ROUND * round(float(np.log(c10)) / _ROUND)))


def build_library(
    solved: SolvedResponses,
    coarse: SolvedResponses,
    observed: Observations,
    asked: Sequence[Mechanism],
    jobs: int,
    progress: Progress,
    stiffening: float = 0.0,
    middle: float | None = None,
    stiffenings: Sequence[float] = STIFFENINGS,
) -> Library:
    """Solve what isn't kept yet, in processes, and return the library for recordings.

    Parameters
    ----------
    solved
        The leg's responses on the mesh that is reported on: elastic curves.
    coarse
        On a coarser one: relative changes, in which most of a mesh's error cancels.
    observed
        The recordings, for their stiffness and their protocols.
    asked
        Mechanisms that are to be tabulated.
    jobs
        Processes.
    progress
        Told of every solution.
    stiffening
        ln(1 + C20 / C10) at which changes are tabulated.
    middle
        C10 (kPa) about which; that of the recordings by default.
    stiffenings
        ln(1 + C20 / C10) of the elastic curves.
    """
    if middle is None:
        progress.stage("how stiff the leg is, roughly")
        middle = middle_of(observed, coarse, stiffening)
    tissue = [m for m in asked if isinstance(m, TissueMechanism)]
    tasks = tasks_for(observed, tissue, middle, stiffening, coarse.variants, stiffenings)
    progress.stage("the leg's library of responses", len(tasks))
    found = outcomes_of((solved, coarse), tasks, jobs, progress)
    outcomes = [found[k] for k in range(len(tasks))]
    return _assembled(solved, observed, tissue, tasks, outcomes, middle)


def _assembled(
    solved: SolvedResponses,
    observed: Observations,
    tissue: Sequence[TissueMechanism],
    tasks: Sequence[Task],
    outcomes: Sequence[Mapping[str, FloatArray] | None],
    middle: float,
) -> Library:
    done = [(t, o) for t, o in zip(tasks, outcomes, strict=True) if o is not None]
    elastic = [(t.point, o) for t, o in done if t.mechanism is None and t.geometry is None and not t.material]
    c10, c20 = (np.array(values) for values in zip(*(p for p, _ in elastic), strict=True))
    force, by_c10, by_c20 = (np.array([o[name] for _, o in elastic]) for name in ("force", "deep.C10", "deep.C20"))
    samples = _samples(c10, c20, force, by_c10 / 1e3, by_c20 / 1e3)
    changes: dict[tuple[str, str], Table] = {}
    missing: dict[str, str] = {}
    for m in tissue:
        for key in [s.key for s in observed.protocols] if m.along_path else [""]:
            table = _table(m, key, tasks, outcomes)
            if table is None and m.does_without:
                table = unchanged(m, solved.grid)
            if table is None:
                missing[m.name] = "its solutions did not follow the protocol to the end"
            else:
                changes[m.name, key] = table
    geometric = {t.geometry.name: o["change"] for t, o in done if t.geometry is not None}
    material = next((dict(o) for t, o in done if t.material), {})
    nuisances = NuisanceChanges(
        solved.grid,
        {name: smoothed(solved.grid, change) for name, change in geometric.items()},
        {name: smoothed(solved.grid, change) for name, change in material.items()},
    )
    emulator = Emulator(samples)
    return Library(solved.grid, emulator, changes, nuisances, middle, missing)


def smoothed(grid: FloatArray, change: FloatArray) -> FloatArray:
    """Return a relative change of the force (m,) without what elements do that come into contact.

    On a coarse mesh a derivative wiggles by some per cent of itself as each of them does, and a
    leg that is known well enough tells such wiggles from noise. A solution that stopped has no
    number to smooth.

    Parameters
    ----------
    grid
        (m,), mm.
    change
        (m,).
    """
    if len(grid) < _FEWEST or not np.isfinite(change).all():
        return change
    log = np.log(grid)
    found = np.asarray(make_smoothing_spline(log, change, lam=_SMOOTH)(log))
    # What moves by more is a course of its own, as where a force vanishes, and no wiggle.
    return found if np.abs(found - change).max() < _WIGGLE * np.abs(change).max() else change


def _samples(c10: FloatArray, c20: FloatArray, force: FloatArray, by_c10: FloatArray, by_c20: FloatArray) -> Samples:
    """Return solved curves (n, m) with their derivatives (N/kPa) by the coordinates."""
    first = c10[:, None] * by_c10 + c20[:, None] * by_c20
    second = (c10 + c20)[:, None] * by_c20
    return Samples(coordinates(c10, c20), force, np.stack([first, second], axis=1))


def _table(
    mechanism: TissueMechanism, key: str, tasks: Sequence[Task], outcomes: Sequence[Mapping[str, FloatArray] | None]
) -> Table | None:
    ratios = bool(mechanism.strengths) and not mechanism.along_path
    rows: dict[float, list[Mapping[str, FloatArray] | None]] = {}
    for task, outcome in zip(tasks, outcomes, strict=True):
        own = "" if task.stations is None else task.stations.key
        if task.mechanism is mechanism and own == key and task.node is None:
            # Where no force is left there is no ratio to tabulate.
            left = outcome is not None and not (ratios and np.any(outcome["change"] <= -1.0))
            rows.setdefault(task.point[0], []).append(outcome if left else None)
    # One stiffness serves where a solution at the other stopped.
    whole = {c10: [o["change"] for o in found if o is not None] for c10, found in rows.items()}
    whole = {c10: changes for c10, changes in whole.items() if len(changes) == len(rows[c10])}
    if not whole:
        return None
    values = np.array([np.vstack(changes) for changes in whole.values()])
    solved = [o for t, o in zip(tasks, outcomes, strict=True) if t.mechanism is mechanism and t.node is not None]
    if not mechanism.along_path and mechanism.nodes:
        values = np.concatenate([values, _missed_at_nodes(mechanism, solved, values[0])[None]], axis=1)
    logs = np.log(list(whole))
    return Table(logs, np.log1p(values) if ratios else values)


def _missed_at_nodes(
    mechanism: TissueMechanism, solved: Sequence[Mapping[str, FloatArray] | None], rows: FloatArray
) -> FloatArray:
    """Return what the derivatives (k, m) miss of the changes at the nodes; nothing where a solution stopped."""
    missed = []
    for node, outcome in zip(mechanism.nodes, solved, strict=True):
        by_rows = mechanism.shares(node)[: len(rows)] @ rows
        missed.append(np.zeros(rows.shape[1]) if outcome is None else outcome["change"] - by_rows)
    return np.array(missed)

"""What a leg's library is solved of: tasks for processes, and their outcomes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from legfem.common.progress import Progress
from legfem.common.units import FloatArray
from legfem.diagnose.mechanisms.base import Stiffness, TissueMechanism, null_of
from legfem.diagnose.models import Displaced, Models
from legfem.diagnose.observations import Observations
from legfem.diagnose.solved import NotKeptError, SolvedResponses
from legfem.diagnose.stations import Stations
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
    models: Models,
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
    return tasks


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

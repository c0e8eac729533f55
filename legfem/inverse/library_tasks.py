"""What a body's library is solved of: its entries, and their solutions in processes."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from legfem.common.progress import Progress, TimeIsUpError
from legfem.common.units import mpa_to_kpa
from legfem.data.phases import LOADING
from legfem.inverse.catalogue import LawName
from legfem.inverse.library import Detail, pair_strength
from legfem.inverse.mechanism import Stiffness, TissueMechanism, Values, null_of
from legfem.inverse.observations import Observations
from legfem.inverse.responses import PLAIN, BodyModels, Columns, NotKeptError, SolvedResponses, at_displacement
from legfem.inverse.stations import Stations
from legfem.jobs.pool import Workers

LOGS, STIFFENINGS = (-0.7, 0.0, 0.7), (0.0, 0.8, 1.6)
"""Logarithms of C10 over the middle's, and ln(1 + C20 / C10), of the elastic curves."""
CHANGES_AT = (-0.35, 0.35)
"""Logarithms of C10 over the middle's, at which changes are tabulated."""


STIFFENING: Mapping[LawName, float] = {"neo-hookean": 0.0, "reduced-polynomial": 0.8}
"""ln(1 + C20 / C10) at which changes are tabulated, by a tissue's law."""
_SCREENED = 3
"""Strengths from which a mechanism is screened by fewer."""
ROUND = 0.25
"""Of the middle's ln C10; and of where its stiffening is looked up."""
_ROUND_FROM, _FIRST_C10 = 1e-3, 0.8e-3
"""MPa: the stiffness from which those logarithms count, and the one that is tried first."""


@dataclass(frozen=True)
class Task:
    """One entry of the library."""

    point: Stiffness
    mechanism: TissueMechanism | None = None
    strength: float = 0.0
    stations: Stations | None = None
    derivatives: tuple[str, ...] = ()
    """By which its elastic courses are differentiated: assumed numbers, errors of the geometry."""
    node: Values | None = None
    pair: tuple[tuple[TissueMechanism, float], ...] = ()
    beside: tuple[TissueMechanism, float] | None = None
    """Mechanism, with its strength, beside which what it is differentiated by is off."""

    @property
    def label(self) -> str:
        """What progress says."""
        what = "elastic"
        if self.mechanism is not None:
            what = self.mechanism.name
        elif self.derivatives:
            what = "derivatives by outlines, aim and what is assumed"
        elif self.pair:
            what = " beside ".join(m.name for m, _ in self.pair)
        if self.beside is not None:
            what = f"{what} beside {self.beside[0].name}"
        at = "" if self.stations is None else f", {self.stations.label}"
        c10, c20 = map(mpa_to_kpa, self.point)
        return f"{what}{at} at C10 {c10:.3g}, C20 {c20:.3g} kPa"

    @property
    def path(self) -> object:
        """What tells a path in time that gives the derivatives of several mechanisms; other entries are their own."""
        m, stations = self.mechanism, self.stations
        return (m.derived_together, stations.key, self.point) if m and m.derivatives and stations else id(self)


type Outcome = Mapping[str, Columns]
"""An entry's changes or courses, by the parameter of which there are several; else of none."""
ONE = ""


def _work(solved: SolvedResponses, task: Task) -> Outcome | None:
    """Return an entry; None where its solution stopped."""
    found = _solved(solved, task)
    return None if any(np.isnan(columns["force"]).any() for columns in found.values()) else found


def _solved(solved: SolvedResponses, task: Task) -> Outcome:
    mechanism = task.mechanism
    leg = PLAIN if task.beside is None else task.beside[0].solution(_values_at(*task.beside))
    if task.derivatives:
        return solved.sensitivities(task.derivatives, task.point, leg)
    if task.pair:
        found = solved.pair_change([(m, _values_at(m, strength)) for m, strength in task.pair], task.point)
    elif mechanism is None:
        found = solved.elastic(task.point)
    elif task.node is not None:
        found = solved.elastic_change(mechanism.solution(task.node), task.point)
    elif mechanism.derivatives:
        found = solved.by_derivatives(mechanism, task.stations, task.point)
    else:
        solution = mechanism.solution(_values_at(mechanism, task.strength))
        if task.stations is None:
            found = solved.elastic_change(solution, task.point)
        else:
            found = solved.path_change(solution, task.stations, task.point)
    return {ONE: found}


def _values_at(mechanism: TissueMechanism, strength: float) -> Values:
    nulls = {p.name: null_of(p) for p in mechanism.parameters}
    return {**nulls, mechanism.parameters[0].name: strength}


def tasks_for(
    observed: Observations,
    tissue: Sequence[TissueMechanism],
    middle: float,
    stiffening: float,
    models: BodyModels,
    lattice: Sequence[tuple[float, float]],
    detail: Detail,
) -> list[Task]:
    """Return what a library is solved of: at a middle C10 (MPa) and about it.

    ``stiffening`` is ln(1 + C20 / C10) where changes are tabulated, ``lattice`` has ln C10 over the middle's and
    ln(1 + C20 / C10) of the elastic curves, ``detail`` is what is solved beyond the screening of all.
    """

    def point(log: float, q: float) -> Stiffness:
        return stiffness_at(middle * float(np.exp(log)), q)

    where = [point(log, stiffening) for log in CHANGES_AT]
    centre = point(0.0, stiffening)
    # What takes longest comes first, which keeps all processes busy to the end.
    along = [m for m in tissue if m.along_path]
    tasks = [
        Task(centre, m, strength, stations)
        for m in along
        for stations in observed.protocols
        for strength in _strengths(m, detail)
    ]
    tasks += [Task(point(*one)) for one in lattice]
    if unknowns := unknowns_of(models):
        tasks.append(Task(centre, derivatives=unknowns))
    if observed.channels:
        of_whole = [m for m in tissue if m.alters_nuisances and m.name in detail.whole]
        altering = [(m, at) for m in of_whole if (at := pair_strength(m)) is not None]
        tasks += [Task(centre, derivatives=unknowns, beside=one) for one in altering]
    tasks += [
        Task(at, m, strength)
        for m in tissue
        if not m.along_path
        for at in ((where if m.name in detail.whole else where[:1]) if m.strengths else [centre])
        for strength in _strengths(m, detail)
    ]
    beside = [(m, strength) for m in tissue if (strength := pair_strength(m)) is not None]
    for pair in combinations(beside, 2):
        one, other = (m.solution(_values_at(m, strength)) for m, strength in pair)
        # Of pairs that a model shows, where each by itself is solved, too.
        if frozenset(m.name for m, _ in pair) in detail.pairs and one.joined(other) is not None:
            tasks.append(Task(where[0], pair=pair))
    far = [m for m in tissue if not m.along_path and m.name in detail.whole]
    return tasks + [Task(centre, m, node=node) for m in far for node in m.nodes]


def unknowns_of(models: BodyModels) -> tuple[str, ...]:
    """Return what isn't known exactly of a body, by which its courses are differentiated."""
    return (*models.assumed, *models.geometric)


def _strengths(mechanism: TissueMechanism, detail: Detail) -> tuple[float, ...]:
    """Return the strengths at which a mechanism is solved; every second one where it is only screened."""
    every = mechanism.strengths or (0.0,)
    return every if mechanism.name in detail.whole or len(every) < _SCREENED else every[::2]


def cross(stiffening: float) -> list[tuple[float, float]]:
    """Return the elastic curves' places along a stiffening, and along the middle C10."""
    return list(dict.fromkeys([*((log, stiffening) for log in LOGS), *((0.0, q) for q in STIFFENINGS)]))


def middle_of(observed: Observations, solved: SolvedResponses, stiffening: float) -> float:
    """Return the C10 (MPa, of a round logarithm) at which the loading is about as recorded.

    Parameters
    ----------
    observed
        The recordings.
    solved
        Responses by full solutions.
    stiffening
        ln(1 + C20 / C10) there.
    """
    log = np.log(_FIRST_C10)
    for _ in range(5):
        ratio, _ = _beside(observed, solved, stiffness_at(float(np.exp(log)), stiffening))
        if np.isnan(ratio):
            log += 0.7
            continue
        step = float(np.clip(np.log(max(ratio, 1e-3)) / 0.7, -1.5, 1.5))
        log += step
        if abs(step) < 0.5 * ROUND:
            break
    return rounded(float(np.exp(log)))


def nearest_stiffening(observed: Observations, solved: SolvedResponses, middle: float, among: Sequence[float]) -> float:
    """Return which ln(1 + C20 / C10) the loading goes with, a middle C10 (MPa) scaling its force."""
    misfits = [_beside(observed, solved, stiffness_at(middle, q))[1] for q in among]
    return among[int(np.argmin(np.nan_to_num(misfits, nan=np.inf)))]


def _beside(observed: Observations, solved: SolvedResponses, stiffness: Stiffness) -> tuple[float, float]:
    """Return the factor on an elastic solution's force that meets the loading best, and its misfit (N); NaN of none."""
    loading = observed.phase == LOADING
    force = observed.force[loading]
    there = at_displacement(solved.grid, solved.curve(*stiffness), observed.displacement[loading])
    ratio = float(force @ there) / float(there @ there)
    return ratio, float(np.linalg.norm(force - ratio * there))


def stiffness_at(c10: float, stiffening: float) -> Stiffness:
    """Return C10 and C20 (MPa) of a C10 (MPa) and of ln(1 + C20 / C10): to the last bit, as solves are kept by them."""
    return c10, c10 * float(np.expm1(stiffening))


def rounded(c10: float) -> float:
    """Return a stiffness (MPa) of a round logarithm near one."""
    return _ROUND_FROM * float(np.exp(ROUND * round(float(np.log(c10 / _ROUND_FROM)) / ROUND)))


def outcomes_of(
    solved: SolvedResponses, tasks: Sequence[Task], jobs: int, progress: Progress
) -> dict[int, Outcome | None]:
    """Return tasks' outcomes by their places; processes are started for what isn't kept only.

    Two stages are told of, since courses in time take longer than elastic curves, and a stage's time left is that of
    its own tasks. What `legfem.common.progress.Until` leaves no time for has no outcome.
    """
    found: dict[int, Outcome | None] = {}
    kept = replace(solved, only_kept=True)
    for place, task in enumerate(tasks):
        with suppress(NotKeptError):
            found[place] = _work(kept, task)
    if found:
        progress.stage(f"{len(found)} of {len(tasks)} responses are kept from earlier runs")
    missing = [place for place in range(len(tasks)) if place not in found]
    firsts = {tasks[place].path: place for place in reversed(missing)}
    beside = {place: firsts[tasks[place].path] for place in missing if place not in firsts.values()}
    missing = [place for place in missing if place not in beside]
    stages = {"elastic responses": False, "responses in time": True}
    with Workers(_work, solved, jobs) as workers, suppress(TimeIsUpError):
        for name, in_time in stages.items():
            places = [place for place in missing if (tasks[place].stations is not None) == in_time]
            if places:
                progress.stage(f"the leg's {name}", len(places))
            for number, outcome in workers.places([tasks[place] for place in places]):
                place = places[number]
                found[place] = outcome
                progress.advance(tasks[place].label + ("" if outcome is not None else ": STOPPED"))
    # What another's path gave, too, is recalled.
    return found | {place: _work(solved, tasks[place]) for place, first in beside.items() if first in found}

"""Building a body's library of responses: the tables of what was solved."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import make_smoothing_spline

from legfem.common.progress import Progress, Silent, TimeIsUpError
from legfem.common.units import FloatArray
from legfem.inverse.emulator import NUGGET, Emulator, Kriging
from legfem.inverse.library import (
    NO_CHANNELS,
    UNTRIED,
    ChannelTables,
    Detail,
    Library,
    NuisanceChanges,
    Table,
    coordinates,
    unchanged,
)
from legfem.inverse.library_tasks import ONE, Outcome, Task, cross, outcomes_of, stiffness_at, tasks_for, unknowns_of
from legfem.inverse.mechanism import Mechanism, Stiffness, TissueMechanism, prior_of
from legfem.inverse.observations import Observations
from legfem.inverse.responses import ELASTIC_DERIVATIVES, Columns, SolvedResponses, channels_of, derivative_of

_SMOOTH = 3e-3
"""Penalty of the squared second derivative by the logarithm of the way: at 5 mm waves of less than
3 mm go."""
_WIGGLE = 0.1
"""Largest share of a change that counts as a wiggle."""
_FEWEST = 5
"""Points of a curve that can be smoothed."""


def build_library(
    solved: SolvedResponses,
    observed: Observations,
    asked: Sequence[Mechanism],
    jobs: int,
    progress: Progress,
    middle: float,
    stiffening: float = 0.0,
    detail: Detail | None = None,
    lattice: Sequence[tuple[float, float]] = (),
) -> Library:
    """Solve what isn't kept yet, and return the library; what can't be screened at one stiffness is solved in full.

    Parameters
    ----------
    solved
        The leg's responses. A coarse mesh will do: most of its error cancels in relative changes, and what is left of
        elastic curves where they are corrected by one solution on a finer mesh.
    observed
        The recordings, for their stiffness and their protocols.
    asked
        Mechanisms that are to be tabulated.
    jobs, progress
        Processes; told of every solution, and what it leaves no time for is missing.
    middle, stiffening
        C10 (MPa) and ln(1 + C20 / C10) about which changes are tabulated.
    detail
        What is solved beyond the screening of all mechanisms; everything without it.
    lattice
        ln C10 over the middle's and ln(1 + C20 / C10) of the elastic curves; a `cross` without it.

    Raises
    ------
    TimeIsUpError
        If there was no time for the base model, or for all of the detail.
    """
    tissue = [m for m in asked if isinstance(m, TissueMechanism)]
    detail = Detail.of_all(tissue) if detail is None else detail
    if detail.whole:
        progress.stage(f"solving in full: {', '.join(sorted(detail.whole))}")
    lattice = lattice or cross(stiffening)
    library: Library | None = None
    while True:
        tasks = tasks_for(observed, tissue, middle, stiffening, solved.variants, lattice, detail)
        found = outcomes_of(solved, tasks, jobs, progress)
        begun = {t.mechanism.name if t.mechanism else "" for k, t in enumerate(tasks) if k not in found}
        if begun and library is not None:
            return library
        if begun and (detail != Detail() or "" in begun):
            raise TimeIsUpError
        # What is screened in part says nothing yet.
        used = [(tasks[k], found[k]) for k in sorted(found) if (m := tasks[k].mechanism) is None or m.name not in begun]
        library = replace(_assembled(solved, observed, tissue, used, middle), detail=detail)
        if begun or library.missing.keys() <= detail.whole:
            return library
        detail |= Detail(frozenset(library.missing))


def base_library(
    solved: SolvedResponses, observed: Observations, middle: float, stiffening: float, derivatives: bool
) -> Library | None:
    """Return a library of the base model alone, by one elastic curve; None where that stops.

    Parameters
    ----------
    solved
        Responses.
    observed
        The recordings.
    middle, stiffening
        C10 (MPa) and ln(1 + C20 / C10) there.
    derivatives
        Whether by the geometry and by what is assumed, too.
    """
    point = stiffness_at(middle, stiffening)
    tasks = [Task(point)] + [Task(point, derivatives=unknowns_of(solved.variants))] * derivatives
    found = outcomes_of(solved, tasks, 1, Silent())
    if found[0] is None:
        return None
    made = [(tasks[place], outcome) for place, outcome in found.items()]
    return replace(_assembled(solved, observed, (), made, middle), beside=NO_CHANNELS)


def geometric_changes(
    responses: SolvedResponses, observed: Observations, stiffness: Stiffness, jobs: int, progress: Progress
) -> NuisanceChanges:
    """Solve what errors of the geometry, and of what is assumed, do to the elastic courses; none where that stops.

    Parameters
    ----------
    responses
        The body's, as those of a library.
    observed
        The recordings, for their channels.
    stiffness
        C10 and C20, MPa.
    jobs, progress
        See `build_library`.
    """
    tasks = [Task(stiffness, derivatives=unknowns_of(responses.variants))]
    done = [(tasks[0], one) for one in outcomes_of(responses, tasks, jobs, progress).values() if one is not None]
    return _nuisances(responses, done, _known_channels(done) if observed.channels else ())


type _Made = tuple[Task, Outcome | None]
"""A task and what came of it."""


def _assembled(
    solved: SolvedResponses, observed: Observations, tissue: Sequence[TissueMechanism], made: list[_Made], middle: float
) -> Library:
    done = [(t, o) for t, o in made if o is not None]
    elastic = [(t.point, o[ONE]) for t, o in done if not (t.mechanism or t.derivatives or t.pair)]
    names = _known_channels(done)
    made = _filled(made, names)
    changes: dict[tuple[str, str], Table] = {}
    beside: dict[tuple[str, str], Table] = {}
    missing: dict[str, str] = {}
    for m in tissue:
        for key in [s.key for s in observed.protocols] if m.along_path else [""]:
            table, other = _table(m, key, made), _table(m, key, made, names)
            if table is None and m.does_without:
                table = unchanged(m, len(solved.grid))
                other = unchanged(m, (len(solved.grid) + 1) * len(names))
            if table is None or other is None:
                tried = any(task.mechanism is m for task, _ in made)
                missing[m.name] = "simulations did not reach the end of the protocol" if tried else UNTRIED
            else:
                changes[m.name, key], beside[m.name, key] = table, other
    nuisances = _nuisances(solved, done, names)
    altered = {
        m.name: _nuisances(solved, done, names, m).plus(-1.0, nuisances)
        for m in tissue
        if any(t.beside is not None and t.beside[0] is m for t, _ in done)
    }
    tables = NO_CHANNELS
    if names:
        # Channels themselves, not their logarithms, as they may change sign.
        tables = ChannelTables(names, Kriging(*_samples(elastic, names), NUGGET), beside)
    pairs = {
        frozenset(m.name for m, _ in t.pair): {
            "force": smoothed(solved.grid, o[ONE]["force"]),
            **{name: o[ONE][name] for name in names if _has(o, name)},
        }
        for t, o in done
        if t.pair
    }
    force = ChannelTables(("force",), Emulator(*_samples(elastic, ("force",))), changes)
    return Library(solved.grid, force, nuisances, middle, missing, beside=tables, pairs=pairs, altered=altered)


def _nuisances(
    solved: SolvedResponses,
    done: Sequence[tuple[Task, Outcome]],
    names: Sequence[str],
    beside: TissueMechanism | None = None,
) -> NuisanceChanges:
    """Return what is known of nuisances, beside a mechanism or without any."""
    grid, assumed = solved.grid, solved.variants.assumed
    known = {
        by: {"force": smoothed(grid, change["force"]), **{name: change[name] for name in names if name in change}}
        for task, outcome in done
        if task.derivatives and (task.beside[0] if task.beside else None) is beside
        for by, change in outcome.items()
    }
    material = {name: known[name] for name in assumed if name in known}
    return NuisanceChanges(grid, {name: one for name, one in known.items() if name not in material}, material)


def _known_channels(done: Sequence[tuple[Task, Outcome]]) -> tuple[str, ...]:
    """Return the channels beside the force that every elastic solution and every nuisance's has.

    Of a mechanism one solution has to have it: see `_filled`.
    """
    found: dict[str, list[set[str]]] = {}
    for number, (task, outcome) in enumerate(done):
        if task.pair or task.beside is not None:
            continue
        there = [
            {name for name in channels_of(columns) if np.isfinite(columns[name]).all()} for columns in outcome.values()
        ]
        needed = (
            str(number) if task.mechanism is None else f"{task.mechanism.name} {task.stations and task.stations.key}"
        )
        found.setdefault(needed, []).append(set.intersection(*there) if there else set())
    known = [set.union(*own) for own in found.values()]
    order = [name for _, outcome in done for columns in outcome.values() for name in channels_of(columns)]
    return tuple(name for name in dict.fromkeys(order) if all(name in own for own in known))


def _filled(made: Sequence[_Made], names: Sequence[str]) -> list[_Made]:
    """Return tasks' outcomes with every channel: one that a solution hasn't is in proportion to the nearest strength's.

    The line of travel of a tilted cylinder may miss the bone, and the muscle's thickness then isn't there.
    """
    found = list(made)
    for place, (task, outcome) in enumerate(made):
        m = task.mechanism
        missing = [] if m is None or outcome is None else [n for n in names if not _has(outcome, n)]
        if m is None or outcome is None or not missing:
            continue
        if task.node is not None:
            found[place] = task, None
            continue
        alike = [
            (other, columns)
            for other, columns in made
            if columns is not None and other.mechanism is m and other.node is None and other.stations is task.stations
        ]
        columns = dict(outcome[ONE])
        for name in missing:
            near, has = min(
                ((other, one) for other, one in alike if _has(one, name)),
                key=lambda pair: (abs(_departure(pair[0]) - _departure(task)), abs(pair[0].point[0] - task.point[0])),
            )
            share = _departure(task) / _departure(near) if m.strengths else 1.0
            columns[name] = share * has[ONE][name]
        found[place] = task, {ONE: columns}
    return found


def _has(outcome: Outcome, name: str) -> bool:
    return name in outcome[ONE] and bool(np.isfinite(outcome[ONE][name]).all())


def _departure(task: Task) -> float:
    assert task.mechanism is not None
    return prior_of(task.mechanism.parameters[0]).departure(task.strength)


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


def _samples(
    elastic: Sequence[tuple[Stiffness, Columns]], names: Sequence[str]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return coordinates (n, 2), solved courses (n, m) of channels, each as one row, and their derivatives by those."""
    c10, c20 = (np.array(values) for values in zip(*(point for point, _ in elastic), strict=True))
    course = np.array([_as_row(columns, names) for _, columns in elastic])
    by_c10, by_c20 = (
        np.array([_as_row(columns, [derivative_of(name, of) for name in names]) for _, columns in elastic])
        for of in ELASTIC_DERIVATIVES
    )
    first = c10[:, None] * by_c10 + c20[:, None] * by_c20
    second = (c10 + c20)[:, None] * by_c20
    return coordinates(c10, c20), course, np.stack([first, second], axis=1)


def _as_row(columns: Columns, names: Sequence[str]) -> FloatArray:
    """Return channels (..., m) as rows (..., m k), the k channels of a place beside each other."""
    stacked = np.stack([columns[name] for name in names], axis=-1)
    return stacked.reshape(*stacked.shape[:-2], -1)


def _table(
    mechanism: TissueMechanism, key: str, made: Sequence[_Made], names: Sequence[str] = ("force",)
) -> Table | None:
    ratios = bool(mechanism.strengths) and not mechanism.along_path
    rows: dict[float, list[Outcome | None]] = {}
    strengths: dict[float, None] = {}
    for task, outcome in made:
        own = "" if task.stations is None else task.stations.key
        if task.mechanism is mechanism and own == key and task.node is None:
            # Where no force is left there is no ratio to tabulate.
            left = outcome is not None and not (ratios and np.any(outcome[ONE]["force"] <= -1.0))
            rows.setdefault(task.point[0], []).append(outcome if left else None)
            strengths[task.strength] = None
    if not names:
        return unchanged(mechanism, 0)
    # One stiffness serves where a solution at the other stopped.
    whole = {c10: [_as_row(o[ONE], names) for o in found if o is not None] for c10, found in rows.items()}
    whole = {c10: changes for c10, changes in whole.items() if len(changes) == len(rows[c10])}
    if not whole:
        return None
    values = np.array([np.vstack(changes) for changes in whole.values()])
    solved = [o for t, o in made if t.mechanism is mechanism and t.node is not None]
    if solved:
        missed = _missed_at_nodes(mechanism, [None if o is None else _as_row(o[ONE], names) for o in solved], values[0])
        values = np.concatenate([values, missed[None]], axis=1)
    logarithmic = ratios and tuple(names) == ("force",)
    return Table(np.log(list(whole)), np.log1p(values) if logarithmic else values, logarithmic, tuple(strengths))


def _missed_at_nodes(mechanism: TissueMechanism, solved: Sequence[FloatArray | None], rows: FloatArray) -> FloatArray:
    """Return what the derivatives (k, m) miss of the changes at the nodes; nothing where a solution stopped."""
    missed = []
    for node, change in zip(mechanism.nodes, solved, strict=True):
        by_rows = mechanism.shares(node)[: len(rows)] @ rows
        missed.append(np.zeros(rows.shape[1]) if change is None else change - by_rows)
    return np.array(missed)

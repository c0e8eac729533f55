"""Many legs, specimens or stockings at once: each is done as by its own command, and all are looked at together."""

from __future__ import annotations

import functools
import logging
import time
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from legfem.api.arguments import check_folder, check_one_of, check_seed, check_whole
from legfem.api.cohort_member import Options, done_with
from legfem.api.loading import Given
from legfem.api.results import Result
from legfem.cohort.members import Member, Members, Task, find_members
from legfem.cohort.rows import Row, cohort_frame, units_frame, write_tables
from legfem.common.errors import InputError
from legfem.common.progress import Progress, duration, progress_on
from legfem.jobs.engines import Died, Engine, EngineName, engine_named, outcomes
from legfem.jobs.key import Contents
from legfem.jobs.store import Store

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from legfem.cohort.population_model import PopulationFit
    from legfem.report.page import WebPage

_log = logging.getLogger(__name__)
DOCUMENT = "cohort.json"
POPULATION = "population.json"
_CODE: Mapping[str, tuple[str, ...]] = {
    "identify": ("legfem.legs.identification", "legfem.specimens.problem", "legfem.cohort.rows"),
    "diagnose": ("legfem.legs.diagnosis", "legfem.specimens.diagnosis", "legfem.cohort.rows"),
    "stocking": ("legfem.stockings.result", "legfem.cohort.rows"),
}
"""Modules that compute a member's numbers: with another code they are computed again."""


@dataclass(frozen=True, eq=False)
class Cohort(Result):
    """What was found of each member of a cohort."""

    members: Members
    options: Options
    rows: tuple[Row, ...]
    """In the members' order."""
    seconds: float = 0.0
    population: tuple[PopulationFit, ...] = ()
    """What new people are like, by parameter, where that was asked for."""

    def summary(self) -> str:
        """Return how many can be believed, what is odd, and what is missing."""
        from legfem.report.cohort import ODD
        from legfem.report.render.text import brief

        return brief(self._page(), (ODD,))

    def document(self) -> dict[str, Any]:
        """Return what ``cohort.json`` holds."""
        from legfem.cohort.statistics import statistics, statistics_document
        from legfem.cohort.suspicions import missing, suspicions
        from legfem.common.documents import json_types, versions_of

        frame = self.to_frame()
        return {
            "schema": "legfem.cohort/1",
            "folder": str(self.members.folder),
            "table": None if self.members.table is None else str(self.members.table),
            "done": self.options.task,
            "options": json_types(dict(self.options.given)),
            "rows": json_types(frame.astype(object).where(frame.notna(), None).to_dict("records")),
            "units": units_frame(frame, self.rows).to_dict("records"),
            "statistics": statistics_document(statistics(self.members.every, self.rows)),
            "suspicions": json_types([asdict(one) for one in suspicions(self.members.every, self.rows)]),
            "missing": missing(self.members.every, self.rows),
            "notes": list(self.members.notes),
            "versions": versions_of("legfem", "dolfinx", "numpy", "scipy", "python"),
        }

    def plot(self) -> Figure:
        """Return the first parameter of all members, sorted, with 95 % intervals."""
        from legfem.report.cohort_statistics import forest_figure

        return forest_figure(self.members.every, self.rows)

    def to_frame(self) -> pd.DataFrame:
        """Return the table: a row a member, with the units in the columns' names."""
        return cohort_frame(self.members.every, self.rows)

    def write(self, folder: Given) -> Path:
        """Write cohort.html and cohort.txt, the table as CSV and workbook, cohort.json; return cohort.txt's path."""
        from legfem.cohort.population_model import population_document
        from legfem.common.documents import write_document
        from legfem.report.cohort import write_cohort_page

        out = Path(folder)
        write_document(out / DOCUMENT, self.document())
        frame = self.to_frame()
        write_tables(frame, units_frame(frame, self.rows), out)
        if self.population:
            write_document(out / POPULATION, population_document(self.population, self.members, self.rows))
        return write_cohort_page(self._page(), out)

    def _rows(self) -> Iterator[dict[str, Any]]:
        yield from self.to_frame().to_dict("records")

    def _page(self) -> WebPage:
        from legfem.report.cohort import cohort_web_page
        from legfem.report.page import command_line

        return cohort_web_page(self.members, self.rows, self.options.task, command_line(), self.population)


@dataclass(frozen=True)
class ExpectedRun:
    """What a run would do, and what it would take."""

    members: Members
    states: tuple[Literal["known", "new", "changed", "missing"], ...]
    """Of the members: the result is there; there is none; files, options or code are others; no such folder."""
    workers: int
    seconds_each: float
    """Of one processor."""
    peak_mb: float
    """Of one process."""
    basis: str
    """Where time and memory come from."""

    @property
    def waiting(self) -> int:
        """How many members are to be done."""
        return sum(state in ("new", "changed") for state in self.states)

    def summary(self) -> str:
        """Return a line a member, and time and memory of all."""
        lines = [f"{state:8} {one.name}" for state, one in zip(self.states, self.members.every, strict=True)]
        seconds = -(-self.waiting // self.workers) * self.seconds_each
        memory = min(self.workers, self.waiting) * self.peak_mb / 1000
        each = f"{self.seconds_each:.0f} s and {self.peak_mb:.0f} MB each, {self.basis}"
        todo = f"{self.waiting} of {len(self.states)} to do, {self.workers} at once"
        last = f"{todo}: about {duration(seconds)} and {memory:.1f} GB of memory ({each})"
        return "\n".join([*lines, *self.members.notes, last]) + "\n"


_TYPICAL: Mapping[str, tuple[float, float]] = {
    "identify": (25.0, 500.0),
    "diagnose": (200.0, 900.0),
    "stocking": (60.0, 900.0),
}
"""Seconds of a processor and MB of the members that come with legfem (``legfem cohort`` writes both)."""


def cohort(
    folder: Given,
    *,
    do: Task = "identify",
    layout: str = "",
    table: Given | None = None,
    law: str | None = None,
    identify: Sequence[str] | None = None,
    prior: Sequence[str] = (),
    fix: Sequence[str] = (),
    depth: float | None = None,
    correction: str | None = None,
    model: Literal["2d", "3d"] | None = None,
    mesh: Literal["coarse"] | None = None,
    library: Given | None = None,
    cells: int | None = None,
    seed: int | None = None,
    out: Given,
    on: EngineName = "local",
    scheduler: str | None = None,
    jobs: int = 1,
    population: bool = False,
    dry_run: bool = False,
    progress: bool = False,
) -> Cohort | ExpectedRun:
    """Identify, diagnose or dress every leg of a cohort, and look at all together.

    A member that fails costs its own row. What is done is kept in ``out``: the same call goes on where it was stopped,
    and does again only members whose files, options or code have changed.

    Parameters
    ----------
    folder : str or Path
        That holds the members' folders, and ``cohort.csv`` or ``cohort.xlsx`` if there is one: a row a member with
        ``folder`` or ``subject``, and any of group, side, session, date, rater, rig, age, sex, BMI and others.
    do : {"identify", "diagnose", "stocking"}
        What is done with each.
    layout : str
        Pattern of the members' folders; without it every folder below that holds a subject.toml or specimen.toml
        (of stockings leg.toml).
    table : str or Path, optional
        In place of ``cohort.csv``.
    law, identify, prior, fix, depth, correction, model, mesh
        As `legfem.identify` takes them; depth, model and mesh don't hold for specimens.
    library : str or Path, optional
        As `legfem.diagnose` takes it.
    cells : int, optional
        As `legfem.stocking` takes it.
    seed : int, optional
        Of searches or draws.
    out : str or Path
        Folder for results and for what is done so far.
    on : {"local", "mpi", "dask"}
        What does members at once: processes here; the ranks of mpirun, all of which call this, and of which the others
        end (SystemExit) when the first is done; or the workers of a dask scheduler, which see the same folders.
    scheduler : str, optional
        Address of the dask scheduler, or the file that it writes.
    jobs : int
        Processes of ``local``. More than one needs the calling script's ``if __name__ == "__main__":``.
    population : bool
        Whether to fit what people are like, for priors of new legs: half a minute.
    dry_run : bool
        Whether only to say what would be done, for how long, and with how much memory.
    progress : bool
        Whether to print what is being done.

    Returns
    -------
    Cohort or ExpectedRun
        With ``summary()``; a Cohort with ``to_frame()``, ``document()``, ``plot()``, ``write(folder)`` and ``rows``.

    Raises
    ------
    InputError
        If there are no members, or the table or an option is wrong.
    """
    check_one_of("do", do, get_args(Task.__value__))
    check_one_of("on", on, get_args(EngineName.__value__))
    check_whole("jobs", jobs, 1)
    if seed is not None:
        check_seed(seed)
    check_folder("out", out)
    started = time.perf_counter()
    given = {"law": law, "identify": identify, "prior": prior, "fix": fix, "depth": depth, "correction": correction}
    given |= {"model": model, "mesh": mesh, "cells": cells, "seed": seed}
    options = _options(do, {name: value for name, value in given.items() if value not in (None, ())}, library)
    with engine_named(on, jobs, scheduler) as engine:
        if engine is not None:
            members = find_members(Path(folder), do, layout, None if table is None else Path(table))
            known = _Known(Path(out), members, options)
            if dry_run:
                return known.expected(engine.workers)
            with progress_on(quiet=not progress) as shown:
                found = _run(known, engine, shown)
            people = _population(members, found, options) if population else ()
            return Cohort(members, options, tuple(found), time.perf_counter() - started, people)
    raise SystemExit(0)  # another rank, which has served the first


def _population(members: Members, rows: Sequence[Row], options: Options) -> tuple[PopulationFit, ...]:
    from legfem.cohort.population_model import populations

    if priors := options.given.get("prior"):
        raise InputError("--population", ", ".join(priors), "would count twice: each leg has it", "leave out --prior")
    return populations(members.every, rows, int(options.given.get("seed", 0)))


_TAKES: Mapping[str, tuple[str, ...]] = {
    "identify": ("law", "identify", "prior", "fix", "depth", "correction", "model", "mesh", "seed"),
    "diagnose": ("correction", "prior", "seed"),
    "stocking": ("cells",),
}


def _options(task: Task, given: Mapping[str, Any], library: Given | None) -> Options:
    for name in given:
        if name not in _TAKES[task]:
            raise InputError(f"--{name}", "given", f"is of no use with --do {task}", "leave it out")
    if library is not None and task != "diagnose":
        raise InputError("--library", "given", f"is of no use with --do {task}", "leave it out")
    return Options(task, given, "" if library is None else str(library))


def _files(member: Member) -> object:
    """All files of a member's folder, and those elsewhere that its TOML names."""
    named: list[str] = []
    for path in sorted(member.folder.glob("*.toml")):
        try:
            named += _texts(tomllib.loads(path.read_text(encoding="utf-8")))
        except (OSError, ValueError):
            continue
    elsewhere = []
    for text in named:
        path = member.folder / text
        if (
            len(text) < 500
            and "\0" not in text
            and path.is_file()
            and not path.resolve().is_relative_to(member.folder.resolve())
        ):
            elsewhere.append(Contents(path))
    return [Contents(member.folder), elsewhere, member.problem]


def _texts(value: Any) -> list[str]:
    if isinstance(value, str):
        return [value]
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return [text for part in parts for text in _texts(part)]


class _Known:
    """What is there of a cohort, and what isn't."""

    def __init__(self, out: Path, members: Members, options: Options) -> None:
        self.out, self.members, self.options = out, members, options
        priors = (Path(text.partition("=")[2].strip()) for text in options.given.get("prior", ()))
        depends = [options.task, options.given, [Contents(path) for path in priors if path.suffix == ".json"]]
        place = itemgetter("place")
        self._store = Store(out / "rows", list[Row], depends, _CODE[options.task], named=place)
        self._asked = {one.name: {"place": one.place.replace("/", "__"), "files": _files(one)} for one in members.every}
        self.rows: dict[str, list[Row]] = {}
        for one in members.every:
            rows = [Row(one.name, problem=one.problem)] if one.problem else self._store.get(self._asked[one.name])
            # A report that was removed is written again.
            if rows is not None and all((out / row.report).is_file() for row in rows if row.report):
                self.rows[one.name] = rows

    def keep(self, name: str, rows: list[Row]) -> None:
        """Keep a member's rows."""
        self._store.put(self._asked[name], rows)

    def expected(self, workers: int) -> ExpectedRun:
        """What a run would do."""
        done = [row for rows in self.rows.values() for row in rows if row.done and row.seconds > 0]
        seconds, peak = _TYPICAL[self.options.task]
        basis = "as of legs that come with legfem"
        if done:
            seconds = sum(row.seconds for row in done) / len(done)
            peak = max(row.peak_mb for row in done)
            basis = f"as of the {len(done)} done here"
        return ExpectedRun(self.members, tuple(map(self._state, self.members.every)), workers, seconds, peak, basis)

    def _state(self, one: Member) -> Literal["known", "new", "changed", "missing"]:
        if one.problem:
            return "missing"
        if one.name in self.rows:
            return "known"
        return "changed" if self._store.path(self._asked[one.name]).is_file() else "new"


def _run(known: _Known, engine: Engine, progress: Progress) -> list[Row]:
    members, found = known.members.every, dict(known.rows)
    for one in members:
        if one.problem:
            _log.warning("%s", one.problem)
    todo = [one for one in members if one.name not in found]
    began = time.perf_counter()
    progress.stage(f"{known.options.task}: {len(members)} members ({len(found)} known){engine.place}", len(todo))
    work = functools.partial(done_with, known.options, known.out)
    for number, (place, made) in enumerate(outcomes(engine, work, todo), 1):
        member = todo[place]
        rows = [Row(member.name, problem=made.problem)] if isinstance(made, Died) else made.rows
        if not isinstance(made, Died) and made.worth:
            known.keep(member.name, rows)
        found[member.name] = rows
        left = (time.perf_counter() - began) / number * (len(todo) - number)
        after = f"; about {duration(left)} left" if number < len(todo) else ""
        problem = next((row.problem for row in rows if row.problem), "")
        progress.advance(f"{member.name}: {problem or f'{rows[0].seconds:.0f} s'}{after}")
    return [row for one in members for row in found[one.name]]

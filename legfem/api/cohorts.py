"""Many legs, specimens or stockings at once: each is done as by its own command, and all are looked at together."""

import functools
import inspect
import logging
import os
import resource
import sys
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from legfem.api import loading
from legfem.api.diagnosis import diagnose
from legfem.api.identification import identify
from legfem.api.results import Diagnosed, Identification, Result
from legfem.api.stockings import Cells, stocking
from legfem.cohort import rows as cohort_rows
from legfem.cohort.anomalies import missing, suspicions
from legfem.cohort.members import Member, Members, Task, find_members
from legfem.cohort.population_model import PopulationFit, population_document, populations
from legfem.cohort.readings import read_readings
from legfem.cohort.statistics import Statistics, statistics
from legfem.common.documents import json_types, versions_of, write_document
from legfem.common.errors import MISSING, Argument, InputError, Remedy, UnsolvedError
from legfem.common.progress import Progress, progress_on
from legfem.geometry.section import CALF, LIMBS, cross, fat_thickness, girth
from legfem.inverse.stored import StoredResult
from legfem.jobs.engines import Died, Engine, EngineName, engine_named, outcomes
from legfem.jobs.store import key_of
from legfem.legs.identification import as_leg
from legfem.legs.subject import SitedLeg, Subject
from legfem.report.answers import headline_of
from legfem.report.cohort import ODD, cohort_web_page, write_cohort_page
from legfem.report.cohort_statistics import STATISTICS, agreement_curves, forest_figure, readings_page
from legfem.report.curves import curves_figure
from legfem.report.folder import made_in_place
from legfem.report.page import PAGE, WebPage, command_line
from legfem.report.render import brief
from legfem.specimens.folder import SpecimenFolder

_log = logging.getLogger(__name__)
DOCUMENT = "cohort.json"
POPULATION = "population.json"


@dataclass(frozen=True, eq=False)
class Cohort(Result):
    """What was found of each member of a cohort."""

    members: Members
    options: cohort_rows.Options
    rows: tuple[cohort_rows.Row, ...]
    """In the members' order."""
    seconds: float = 0.0
    population: tuple[PopulationFit, ...] = ()
    """What new people are like, by parameter, where that was asked for."""

    def summary(self) -> str:
        """Return how many can be believed, what is odd, and what is missing."""
        return brief(self._page(), (ODD,))

    def document(self) -> dict[str, Any]:
        """Return what ``cohort.json`` holds."""
        frame = self.to_frame()
        return {
            "schema": "legfem.cohort/3",
            "answer": self._page().headline.said,
            "folder": str(self.members.folder),
            "table": None if self.members.table is None else str(self.members.table),
            "done": self.options.task,
            "options": json_types(dict(self.options.given)),
            "rows": json_types(frame.astype(object).where(frame.notna(), None).to_dict("records")),
            "units": cohort_rows.units_frame(frame, self.rows).to_dict("records"),
            "statistics": json_types(statistics(self.members.every, self.rows)),
            "suspicions": json_types(suspicions(self.members.every, self.rows)),
            "missing": missing(self.members.every, self.rows),
            "notes": list(self.members.notes),
            "versions": versions_of("legfem", "dolfinx", "numpy", "scipy", "python"),
        }

    def plot(self) -> Figure:
        """Return the first parameter of all members, sorted, with 95 % intervals."""
        return forest_figure(self.members.every, self.rows)

    def to_frame(self) -> pd.DataFrame:
        """Return the table: a row a member, with the units in the columns' names."""
        return cohort_rows.cohort_frame(self.members.every, self.rows)

    def write(self, folder: loading.Given) -> Path:
        """Write cohort.html and cohort.txt, the table as CSV and workbook, cohort.json; return cohort.txt's path."""
        out = Path(folder)
        _check_apart(out, self.members)
        write_document(out / DOCUMENT, self.document())
        frame = self.to_frame()
        with made_in_place(out) as hidden:
            cohort_rows.write_tables(frame, cohort_rows.units_frame(frame, self.rows), hidden)
            if self.population:
                write_document(hidden / POPULATION, population_document(self.population, self.members, self.rows))
            page = write_cohort_page(self._page(), hidden)
        return out / page.name

    def _page(self) -> WebPage:
        return cohort_web_page(self.members, self.rows, self.options.task, command_line(), self.population)


@dataclass(frozen=True, eq=False)
class Readings(Result):
    """How well the readings of a plain table agree."""

    path: Path
    found: Statistics

    def summary(self) -> str:
        """Return the agreement, and what the table doesn't permit."""
        return brief(self._page(), (STATISTICS,))

    def document(self) -> dict[str, Any]:
        """Return what ``cohort.json`` holds."""
        said = {"answer": self._page().headline.said, "table": str(self.path), "statistics": json_types(self.found)}
        return {"schema": "legfem.readings/1", **said, "versions": versions_of("legfem", "numpy", "scipy", "python")}

    def plot(self) -> Figure:
        """Return Bland and Altman's plots; raises ValueError where nothing could be compared."""
        curves = agreement_curves(self.found.parameters)
        if not curves:
            raise ValueError(f"there is nothing to draw: {' '.join(self.found.not_done)}")
        return curves_figure(curves, "Agreement of readings", self.path.name, "measured")

    def to_frame(self) -> pd.DataFrame:
        """Return a row a comparison: ICC, SEM and minimal detectable change, in the values' unit."""
        return pd.DataFrame(
            {"what": one.name, "unit": one.unit, "by": each.by, "detectable": each.agreement.detectable}
            | vars(each.agreement)
            for one in self.found.parameters
            for each in one.repeated
        )

    def write(self, folder: loading.Given) -> Path:
        """Write cohort.html, cohort.txt and cohort.json; return cohort.txt's path."""
        write_document(Path(folder) / DOCUMENT, self.document())
        return write_cohort_page(self._page(), Path(folder))

    def _page(self) -> WebPage:
        return readings_page(self.path, self.found, command_line())


@loading.checked
def cohort(
    folder: loading.Folder | None = None,
    *,
    do: Task = "identify",
    layout: str = "",
    table: loading.Folder | None = None,
    law: str | None = None,
    identify: loading.Texts | None = None,
    prior: loading.Texts = (),
    fix: loading.Texts = (),
    depth: loading.Depth | None = None,
    correction: str | None = None,
    model: Literal["2d", "3d"] | None = None,
    mesh: Literal["coarse"] | None = None,
    library: loading.Folder | None = None,
    cells: Cells | None = None,
    seed: loading.Seed | None = None,
    out: loading.Folder,
    on: EngineName = "local",
    scheduler: str | None = None,
    jobs: loading.Jobs = 1,
    population: bool = False,
    dry_run: bool = False,
    progress: bool = False,
) -> Cohort | Readings | cohort_rows.ExpectedRun:
    """Identify or diagnose every leg of a cohort, or compute its stocking, and compare all of them.

    A member that fails costs its own row. What is done is kept in ``out``: the same call goes on where it was stopped,
    and does again only members whose files, options or code have changed.

    Parameters
    ----------
    folder : str or Path, optional
        That holds the members' folders, and ``cohort.csv`` or ``cohort.xlsx`` if there is one: a row a member with
        ``folder`` or ``subject``, and any of group, side, session, date, rater, rig, age, sex, BMI and others.
    do : {"identify", "diagnose", "stocking"}
        What is done with each.
    layout : str
        Pattern of the members' folders; without it every folder below that holds a subject.toml or specimen.toml
        (of stockings leg.toml).
    table : str or Path, optional
        In place of ``cohort.csv``. Without a folder, a plain table of readings, whose agreement is computed: columns
        member, value (with its unit, as in ``value (kPa)``), visit, rater or method, and any of error, side and group.
    law, identify, prior, fix, depth, correction, model, mesh
        As `legfem.identify` takes them; depth, model and mesh don't hold for specimens.
    library : str or Path, optional
        As `legfem.diagnose` takes it.
    cells : int, optional
        As `legfem.stocking` takes it.
    seed : int, optional
        Seed of searches or draws.
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
    Cohort, Readings or ExpectedRun
        With ``summary()``; a Cohort with ``to_frame()``, ``document()``, ``plot()``, ``write(folder)`` and ``rows``.

    Raises
    ------
    InputError
        If there are no members, or the table or an option is wrong.

    Examples
    --------
    >>> import legfem as lf
    >>> study = lf.cohort("study", do="identify", out="results/cohort-study")  # a folder of legs' folders
    >>> print(study.summary())
    >>> study.to_frame()  # a row a leg
    """
    if folder is None and table is None:
        remedy = Remedy("give the path of the folder that holds the members', or a plain table by ", Argument("table"))
        raise InputError("folder", "members", MISSING, remedy)
    plain = table if folder is None else folder if Path(folder).is_file() else None
    loading.check_folder("out", out)
    started = time.perf_counter()
    given = {"law": law, "identify": identify, "prior": prior, "fix": fix, "depth": depth, "correction": correction}
    given |= {"model": model, "mesh": mesh, "cells": cells, "seed": seed}
    # A path is as good as its text, as in the command.
    texts = {name: str(value) if isinstance(value, Path) else value for name, value in given.items()}
    if plain is not None:
        more = {"layout": layout, "library": library, "population": population, "dry_run": dry_run}
        _check_effect("a plain table of readings", texts | more)
        return Readings(Path(plain), read_readings(Path(plain)))
    _check_effect(do, texts | {"library": library})
    asked = {name: value for name, value in texts.items() if value not in (None, ())}
    options = cohort_rows.Options(do, asked, "" if library is None else str(library))
    if population and prior:
        problem = "would count twice: each leg's folder states it already"
        remedy = Remedy("leave out ", Argument("prior"))
        raise InputError(Argument("population"), ", ".join(prior), problem, remedy)
    with engine_named(on, jobs, scheduler) as engine:
        if engine is not None:
            members = find_members(Path(folder or ""), do, layout, None if table is None else Path(table))
            _check_apart(Path(out), members)
            if mesh == "coarse":
                quick = "The mesh is coarse, for a quick look at all legs: do not rely on the values."
                members = replace(members, notes=(*members.notes, quick))
            known = cohort_rows.KnownRows(Path(out), members, options)
            if dry_run:
                return known.expected(engine.workers)
            with progress_on(quiet=not progress) as shown:
                found = _run(known, engine, shown)
            people = populations(members.every, found, int(options.given.get("seed", 0))) if population else ()
            return Cohort(members, options, tuple(found), time.perf_counter() - started, people)
    raise SystemExit(0)  # another rank, which has served the first


def _check_apart(out: Path, members: Members) -> None:
    """Refuse a folder of results where the study's own table would be written over, or theirs read for it."""
    taken = {members.folder.resolve()} | ({members.table.resolve().parent} if members.table is not None else set())
    if out.resolve() in taken:
        problem = "is where the study's own cohort.csv stands, or would"
        raise InputError(Argument("out"), str(out), problem, "name another folder, or one in it")


_CALLS: Mapping[str, Callable[..., Any]] = {"identify": identify, "diagnose": diagnose, "stocking": stocking}


def _check_effect(task: str, given: Mapping[str, Any]) -> None:
    takes = inspect.signature(_CALLS[task]).parameters if task in _CALLS else ()
    for name, value in given.items():
        if value not in (None, (), "") and value is not False and name not in takes:
            raise loading.wrong(name, "given", f"has no effect on {task}", "leave it out")


def _run(known: cohort_rows.KnownRows, engine: Engine, progress: Progress) -> list[cohort_rows.Row]:
    members, found = known.members.every, dict(known.rows)
    for one in members:
        if one.problem:
            _log.warning("%s", one.problem)
    todo = [one for one in members if one.name not in found]
    refused = None
    progress.stage(f"{known.options.task}: {len(members)} members ({len(found)} known){engine.place}", len(todo))
    work = functools.partial(done_with, known.options, known.out)
    for place, made in outcomes(engine, work, todo):
        member = todo[place]
        rows = [cohort_rows.Row(member.name, problem=made.problem)] if isinstance(made, Died) else made.rows
        if not isinstance(made, Died):
            refused = refused or made.refused
            if made.worth:
                known.keep(member.name, rows)
        found[member.name] = rows
        problem = next((row.problem for row in rows if row.problem), "")
        progress.advance(f"{member.name}: {problem or f'{rows[0].seconds:.0f} s'}")
    rows = [row for one in members for row in found[one.name]]
    if refused is not None and not any(row.done for row in rows):
        raise refused
    return rows


MEMBERS = "members"
"""Folder of the members' own reports, below that of results."""


@dataclass(frozen=True)
class Made:
    """What came of one member."""

    rows: list[cohort_rows.Row]
    worth: bool = True
    """Whether it would come out the same the next time."""
    refused: InputError | None = None
    """An option that it cannot be done with."""


def done_with(options: cohort_rows.Options, out: Path, member: Member) -> Made:
    """Do one member as its own command would, and write its report; what goes wrong is a row too."""
    started = time.perf_counter()
    folder = out / MEMBERS / member.place
    log = logging.getLogger("legfem")
    before = log.level
    try:
        log.setLevel(logging.CRITICAL)  # warnings stand in the member's report and row
        rows = _DOES[options.task](options, member, folder)
    except (InputError, UnsolvedError) as error:
        # The row says whose files they are, wherever the study lies.
        problem = " ".join(str(error).split()).replace(f"{member.folder}{os.sep}", "")
        option = error if isinstance(error, InputError) and isinstance(error.args[0], Argument) else None
        return Made([cohort_rows.Row(member.name, problem=problem)], worth=option is None, refused=option)
    except Exception as error:  # a fault of legfem's own costs this row alone, too
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "error.txt").write_text(traceback.format_exc(), encoding="utf-8")
        said = " ".join(str(error).split())[:200]
        problem = f"unexpected {type(error).__name__}: {said}; please report {folder / 'error.txt'}"
        return Made([cohort_rows.Row(member.name, problem=problem)], worth=False)
    finally:
        log.setLevel(before)
    unit = 1e6 if sys.platform == "darwin" else 1e3
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
    return Made([replace(row, seconds=(time.perf_counter() - started) / len(rows), peak_mb=peak) for row in rows])


def _identified(options: cohort_rows.Options, member: Member, folder: Path) -> list[cohort_rows.Row]:
    given = loading.opened(member.folder)
    found = identify(given, out=folder, **options.given)
    shape = cohort_rows.Shape() if isinstance(given, SpecimenFolder) else _shape(as_leg(given).sites[0])
    return [replace(_fitted(found, member, folder), shape=shape, recordings=_recordings(given))]


def _diagnosed(options: cohort_rows.Options, member: Member, folder: Path) -> list[cohort_rows.Row]:
    given = loading.opened(member.folder)
    found = diagnose(given, library=options.library or None, out=folder, **options.given)
    report = found.write(folder)
    if isinstance(found, Diagnosed):
        row = _row(member, found.document(), "after repair", report)
        assert isinstance(found.subject, Subject)
        return [replace(row, recordings=_recordings(given), shape=_shape(found.subject))]
    rows = []
    alone = len(found.folder.specimens) == 1
    for one in found.specimens:
        part = "" if alone else one.id
        if one.diagnosis is None:
            rows.append(cohort_rows.Row(member.name, part, problem=str(one.problem)))
            continue
        rows.append(replace(_row(member, found[one.id].document(), "after repair", report), part=part))
    return rows


def _dressed(options: cohort_rows.Options, member: Member, folder: Path) -> list[cohort_rows.Row]:
    found = stocking(member.folder, out=folder, **options.given)
    return [replace(_fitted(found, member, folder), fabrics=tuple(found.best.details.fabrics))]


def _fitted(found: Identification, member: Member, folder: Path) -> cohort_rows.Row:
    report, law = found.write(folder, every_rank=True), found.best.law
    content = found.document()
    return replace(_row(member, content, law, report), settings=content["laws"][law]["settings"])


_DOES = {"identify": _identified, "diagnose": _diagnosed, "stocking": _dressed}


def _row(member: Member, content: Mapping[str, Any], preferred: str, report: Path) -> cohort_rows.Row:
    """Return the row of a member's document."""
    shown = report.with_name(PAGE) if report.with_name(PAGE).is_file() else report
    found = StoredResult.read(content)
    sentence = headline_of(found.answer).sentence
    return cohort_rows.Row(
        member.name,
        judged=cohort_rows.Judged(found.answer.tone_with_doubts, sentence, found.every_notice, preferred),
        models=cohort_rows.models_of(found.laws, found.base_model, found.explanations),
        verdict=found.verdict,
        origin=found.origin,
        report=(Path(MEMBERS) / member.place / shown.name).as_posix(),
        versions=found.versions,
    )


def _shape(leg: Subject) -> cohort_rows.Shape:
    """What a leg's section says without a fit."""
    try:
        fat = fat_thickness(leg.section, leg.indenter.aim, leg.indenter.direction)
    except ValueError:
        fat = None
    offset, way = None, leg.indenter.direction
    if leg.section.limb == CALF:
        tibia, fibula = (np.array(leg.section.polygon(bone).centroid.coords[0]) for bone in LIMBS[CALF])
        offset = float(cross(fibula - tibia, way))
    return cohort_rows.Shape(fat, girth(leg.section), offset)


def _recordings(given: Subject | SitedLeg | SpecimenFolder) -> dict[str, str]:
    if isinstance(given, SpecimenFolder):
        return {one.name: key_of(one.recording.displacement, one.recording.force) for one in given.recordings}
    return {
        f"{site.site}/{one.trial}".strip("/"): key_of(one.displacement, one.force)
        for site in as_leg(given).sites
        for one in site.recordings
    }

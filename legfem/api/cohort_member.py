"""One member of a cohort: done as by its own command, with its report, and what was found as a row."""

from __future__ import annotations

import logging
import resource
import sys
import time
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from legfem.api.loading import load_leg, opened
from legfem.cohort.members import Member, Task
from legfem.cohort.rows import Judged, Row, Shape, models_of
from legfem.common.errors import InputError, UnsolvedError
from legfem.jobs.key import key_of

if TYPE_CHECKING:
    from legfem.legs.subject import SitedLeg, Subject
    from legfem.report.page import WebPage
    from legfem.specimens.folder import SpecimenFolder

MEMBERS = "members"
"""Folder of the members' own reports, below that of results."""


@dataclass(frozen=True)
class Options:
    """What is done with every member, and how."""

    task: Task
    given: Mapping[str, Any]
    """Keywords of `legfem.identify`, `legfem.diagnose` or `legfem.stocking`."""
    library: str = ""
    """Folder of responses of a diagnosis; results don't depend on it."""


@dataclass(frozen=True)
class Made:
    """What came of one member."""

    rows: list[Row]
    worth: bool = True
    """Whether it would come out the same the next time."""


def done_with(options: Options, out: Path, member: Member) -> Made:
    """Do one member as its own command would, and write its report; what goes wrong is a row too."""
    started = time.perf_counter()
    folder = out / MEMBERS / member.place
    try:
        with _unheard():
            rows = _DOES[options.task](options, member, folder)
    except (InputError, UnsolvedError) as error:
        return Made([Row(member.name, problem=" ".join(str(error).split()))])
    except Exception as error:  # a fault of legfem's own costs this row alone, too
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "error.txt").write_text(traceback.format_exc(), encoding="utf-8")
        said = " ".join(str(error).split())[:200]
        problem = f"unexpected {type(error).__name__}: {said}; please report {folder / 'error.txt'}"
        return Made([Row(member.name, problem=problem)], worth=False)
    unit = 1e6 if sys.platform == "darwin" else 1e3
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
    seconds = (time.perf_counter() - started) / len(rows)
    return Made([replace(row, seconds=seconds, peak_mb=peak) for row in rows])


@contextmanager
def _unheard() -> Iterator[None]:
    """Keep to itself what is logged: warnings stand in the member's report and row."""
    log = logging.getLogger("legfem")
    before = log.level
    log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        log.setLevel(before)


def _identified(options: Options, member: Member, folder: Path) -> list[Row]:
    from legfem.api.identification import identify
    from legfem.legs.identification import as_leg
    from legfem.report.estimates import preferred
    from legfem.report.kinds import kind_of
    from legfem.specimens.folder import SpecimenFolder

    given = opened(member.folder)
    found = identify(given, out=folder, **options.given)
    report = found.write(folder, every_rank=True)
    content = found.document()
    page = kind_of(found.fits).page(found.fits, None, "", "")
    best = preferred(found.fits)
    shape = Shape() if isinstance(given, SpecimenFolder) else _shape(as_leg(given).sites[0])
    row = _row(member, content, page, best.law, given.origin, report, shape)
    settings = content["laws"][best.law]["settings"]
    return [replace(row, recordings=_recordings(given), settings=settings)]


def _diagnosed(options: Options, member: Member, folder: Path) -> list[Row]:
    from legfem.api.diagnosed import DiagnosedLeg, diagnose
    from legfem.report.diagnosis import diagnosis_web_page
    from legfem.report.diagnosis_document import document
    from legfem.specimens.folder import SpecimenFolder

    given = opened(member.folder)
    found = diagnose(given, library=options.library or None, out=folder, **options.given)
    report = found.write(folder)
    if isinstance(found, DiagnosedLeg):
        page = diagnosis_web_page(found.diagnosis, found.subject)
        row = _row(member, found.document(), page, "after repair", given.origin, report, _shape(found.subject))
        return [replace(row, recordings=_recordings(given))]
    assert isinstance(given, SpecimenFolder)
    rows = []
    alone = len(given.specimens) == 1
    for one in found.specimens:
        part = "" if alone else one.id
        if one.diagnosis is None:
            rows.append(Row(member.name, part, problem=str(one.problem)))
            continue
        content = document(one.diagnosis, one, found.seed, one.seconds)
        page = diagnosis_web_page(one.diagnosis, one)
        row = _row(member, content, page, "after repair", given.origin, report, Shape())
        rows.append(replace(row, part=part))
    return rows


def _dressed(options: Options, member: Member, folder: Path) -> list[Row]:
    from legfem.api.leg_in_stocking import stocking
    from legfem.report.stocking_page import stocking_web_page

    leg = load_leg(member.folder)
    found = stocking(leg, out=folder, **options.given)
    report = found.write(folder)
    page = stocking_web_page(found.result)
    return [_row(member, found.document(), page, "", leg.origin, report, Shape())]


_DOES = {"identify": _identified, "diagnose": _diagnosed, "stocking": _dressed}


def _row(
    member: Member, content: Mapping[str, Any], page: WebPage, preferred: str, origin: str, report: Path, shape: Shape
) -> Row:
    from legfem.report.page import PAGE

    shown = report.with_name(PAGE) if report.with_name(PAGE).is_file() else report
    return Row(
        member.name,
        judged=Judged(page.headline.tone, page.headline.sentence, tuple(page.warnings), preferred),
        models=models_of(content),
        verdict=content.get("verdict", ""),
        origin=origin,
        shape=shape,
        report=(Path(MEMBERS) / member.place / shown.name).as_posix(),
        versions=content["versions"],
    )


def _shape(leg: Subject) -> Shape:
    """What a leg's section says without a fit."""
    import numpy as np

    from legfem.geometry.section import fat_thickness, girth

    try:
        fat = fat_thickness(leg.section, leg.indenter.aim, leg.indenter.direction)
    except ValueError:
        fat = None
    way = leg.indenter.direction
    centres = {name: np.array(leg.section.polygon(name).centroid.coords[0]) for name in ("tibia", "fibula")}
    apart = centres["fibula"] - centres["tibia"]
    beside = float(way[1] * apart[0] - way[0] * apart[1])
    return Shape(fat, girth(leg.section), beside)


def _recordings(given: Subject | SitedLeg | SpecimenFolder) -> dict[str, str]:
    from legfem.legs.identification import as_leg
    from legfem.specimens.folder import SpecimenFolder

    if isinstance(given, SpecimenFolder):
        return {one.name: key_of(one.recording.displacement, one.recording.force) for one in given.recordings}
    return {
        f"{site.site}/{one.trial}".strip("/"): key_of(one.displacement, one.force)
        for site in as_leg(given).sites
        for one in site.recordings
    }

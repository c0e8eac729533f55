"""What is there of a cohort's results, and what a run would do and take."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from typing import Any, Literal

from legfem.cohort.members import Member, Members, Task
from legfem.cohort.rows import Row
from legfem.common.progress import duration
from legfem.jobs.key import Contents
from legfem.jobs.store import Store

_CODE: Mapping[str, tuple[str, ...]] = {
    "identify": ("legfem.legs.identification", "legfem.specimens.problem", "legfem.cohort.rows"),
    "diagnose": ("legfem.legs.diagnosis", "legfem.specimens.diagnosis", "legfem.cohort.rows"),
    "stocking": ("legfem.stockings.identification", "legfem.cohort.rows"),
}
"""Modules that compute a member's numbers: with another code they are computed again."""


@dataclass(frozen=True)
class Options:
    """What is done with every member, and how."""

    task: Task
    given: Mapping[str, Any]
    """Keywords of `legfem.identify`, `legfem.diagnose` or `legfem.stocking`."""
    library: str = ""
    """Folder of responses of a diagnosis; results don't depend on it."""


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


class KnownRows:
    """Rows that are kept in a folder of results."""

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

"""Who is in a cohort: folders below one, and what a table says of each."""

import csv
import difflib
import hashlib
import math
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from functools import partial
from io import StringIO
from pathlib import Path
from typing import Literal

import pandas as pd

from legfem.common.errors import Argument, InputError, Remedy
from legfem.common.input_files import read_text
from legfem.inverse.population import CohortParameter, read_cohort_population

type Task = Literal["identify", "diagnose", "stocking"]
"""What is done with each member: the command of that name."""
FILES: Mapping[str, tuple[str, ...]] = {
    "identify": ("subject.toml", "specimen.toml"),
    "diagnose": ("subject.toml", "specimen.toml"),
    "stocking": ("leg.toml",),
}
"""Of which a member's folder holds one."""
TABLES = ("cohort.csv", "cohort.xlsx")
DESIGN = ("subject", "group", "side", "session", "date", "rater", "rig")
"""Columns whose meaning is known, beside ``folder``; ``subject`` is the person."""
_NUMBERS = ("age", "bmi")
_KNOWN = ("folder", *DESIGN, *_NUMBERS, "sex")
"""Columns that are known however they are capitalised."""
_LIKE = 0.8
"""Likeness from which another column's name may be one of these, misspelt."""
_SIDES = {"l": "left", "left": "left", "r": "right", "right": "right"}


@dataclass(frozen=True)
class Member:
    """One folder of a cohort.

    Parameters
    ----------
    name : str
        The folder's path below the cohort's; one of its own.
    folder : Path
        Where it is.
    person : str
        Whose leg it is; members of one person aren't independent.
    given : Mapping[str, str | float]
        What the table says of it: texts of `DESIGN`, and any other column as numbers where all its cells are.
    problem : str
        Why nothing can be done with it, on one line.
    """

    name: str
    folder: Path
    person: str
    given: Mapping[str, str | float] = field(default_factory=dict)
    problem: str = ""

    @property
    def group(self) -> str:
        """Group in the study; empty where none is given."""
        return str(self.given.get("group", ""))

    @property
    def place(self) -> str:
        """Path below a folder of results, that can be written whatever the name is."""
        parts = Path(self.name).parts
        if parts and not Path(self.name).is_absolute() and ".." not in parts:
            return self.name
        return f"{self.folder.name}-{hashlib.sha256(self.name.encode()).hexdigest()[:8]}"


@dataclass(frozen=True)
class Members:
    """All of a cohort, in order, and what is to be known of the list itself."""

    folder: Path
    every: tuple[Member, ...]
    table: Path | None = None
    notes: tuple[str, ...] = ()
    norms: Mapping[str, CohortParameter] = field(default_factory=dict)
    """What people are like by constant, from a ``population.json`` beside the table."""


def find_members(folder: Path, task: Task, layout: str = "", table: Path | None = None) -> Members:
    """Find a cohort's members.

    Parameters
    ----------
    folder
        The cohort's.
    task
        What is to be done, which says which folders count.
    layout
        Pattern of the members' folders below the cohort's (``P*/leg-*``); without it every folder that holds
        one of `FILES`.
    table
        CSV or workbook with a row a member; one of `TABLES` in the folder without it, if there is one.

    Raises
    ------
    InputError
        If there are none, or the table can't be read or names one twice.
    """
    refused = partial(InputError, folder, "cohort")
    if not folder.is_dir():
        raise refused("not found", "give the folder that contains the subjects' folders")
    found = _folders(folder, task, layout)
    there = [path for name in TABLES if (path := folder / name).is_file()]
    if table is None and len(there) > 1:
        raise refused("both cohort.csv and cohort.xlsx are there", Remedy("name one by ", Argument("table")))
    table = table or next(iter(there), None)
    if table is not None:
        return _of_table(folder, table, found, FILES[task])
    # Called as a table is, but for capitals and its kind.
    like = {str(Path(TABLES[0]).with_suffix(kind)) for kind in (".csv", ".tsv", ".xlsx", ".xls", ".ods", ".numbers")}
    unread = [
        f"{path.name} was not read: call it {' or '.join(TABLES)}, or name it by --table."
        for path in sorted(folder.iterdir())
        if path.is_file() and path.name.lower() in like
    ]
    if not found:
        files = " or ".join(FILES[task])
        where = f"matches {layout!r} and" if layout else "below it"
        remedy = Remedy("check the path, ", Argument("layout"), " and ", Argument("do"))
        raise refused(f"no folder {where} contains {files}", remedy)
    return Members(folder, tuple(Member(name, path, name) for name, path in found.items()), notes=tuple(unread))


def _folders(folder: Path, task: Task, layout: str) -> dict[str, Path]:
    """Folders of a cohort by name."""

    def hidden(path: Path) -> bool:
        return any(part.startswith(".") for part in path.relative_to(folder).parts)

    try:
        below = folder.glob(layout or "**/*")
        places = [folder] * (not layout) + [path for path in below if path.is_dir() and (layout or not hidden(path))]
    except (ValueError, NotImplementedError) as error:
        raise InputError(Argument("layout"), layout, f"is not a pattern ({error})", "write it as in P*/leg-*") from None
    held = [path for path in places if any((path / file).is_file() for file in FILES[task])]
    if not layout:
        # A folder of specimens in one of specimens is one of its tests.
        held = [path for path in held if path == folder or not (path.parent / "specimen.toml").is_file()]
    return {
        folder.resolve().name if path == folder else path.relative_to(folder).as_posix(): path for path in sorted(held)
    }


def _of_table(folder: Path, table: Path, found: Mapping[str, Path], files: Sequence[str]) -> Members:
    cells = cells_of(table)
    column = "folder" if "folder" in cells else "subject"
    near = difflib.get_close_matches("folder", list(cells), n=1, cutoff=_LIKE) if column != "folder" else []
    if near or column not in cells:
        remedy = f"rename '{near[0]}' folder" if near else "add a column called folder"
        missing = "folder" if "subject" in cells else "folder or subject"
        raise InputError(table, "header", f"there is no column {missing}", remedy)
    seen: dict[Path, int] = {}
    spelt = {_composed(name): path for name, path in found.items()}
    members = []
    numbers = {name: numbers for name in cells if (numbers := _as_numbers(cells[name], name)) is not None}
    for name in _NUMBERS:
        if name in cells:
            check_numbers(table, cells, name)
    for place, (line, row) in enumerate(cells.iterrows()):
        given = {name: text for name in cells if name != "folder" and (text := str(row[name]))}
        refused = partial(InputError, table, f"{column}, line {line}")
        if not row[column]:
            raise refused("is empty", "name a folder, or remove the row")
        path = spelt.get(_composed(row[column]), folder / row[column]).resolve()
        if path in seen:
            raise refused(f"'{row[column]}' is in line {seen[path]} too", "remove one")
        seen[path] = int(line)
        known: dict[str, str | float] = {
            name: numbers[name][place] if name in numbers else text for name, text in given.items()
        }
        if "side" in known:
            known["side"] = _SIDES.get(str(known["side"]).lower(), str(known["side"]))
        _check_date(table, int(line), given.get("date", ""))
        problem = _problem(path, row[column], found, files)
        name = str(Path(row[column]))
        members.append(
            Member(name, path, given.get("subject", name), known, problem and f"{table}: line {line}: {problem}")
        )
    if all(one.problem for one in members):
        example = next((f", as {name}" for name in found), "")
        remedy = f"write paths as seen from {folder}{example}"
        raise InputError(table, column, f"none of {len(members)} folders is there", remedy)
    left = [name for name, path in found.items() if path.resolve() not in seen]
    shown = ", ".join(left[:5]) + (", …" if len(left) > 5 else "")
    notes = [f"Not in {table.name}, and so left out: {shown} ({len(left)})."] if left else []
    beside = table.parent / "population.json"
    norms = read_cohort_population(beside).parameters if beside.is_file() else {}
    return Members(folder, tuple(members), table, (*notes, *_doubts(table, cells, members)), norms)


def check_numbers(table: Path, cells: pd.DataFrame, name: str, positive: bool = True) -> None:
    """Refuse cells of a column that are neither empty nor a finite number, or aren't above 0 where they have to be."""
    for line, value in plain_numbers(cells[name]).items():
        text = cells[name][line]
        refused = partial(InputError, table, f"{name}, line {line}")
        if text and not math.isfinite(value):
            raise refused(f"'{text}' is not a number", "write the number alone")
        if positive and value <= 0:
            raise refused(f"is {text}", "write a number above 0, or leave it empty")


def _composed(name: str) -> str:
    """Return a folder's name with / between its parts and each accent in one character, which can't be seen."""
    return unicodedata.normalize("NFC", Path(name.replace("\\", "/")).as_posix())


def _doubts(table: Path, cells: pd.DataFrame, members: Sequence[Member]) -> list[str]:
    """What is read as it stands, and may be meant otherwise."""
    absent = [name for name in _KNOWN if name not in cells]
    notes = []
    for name in cells:
        near = difflib.get_close_matches(str(name).lower(), absent, n=1, cutoff=_LIKE) if name not in _KNOWN else []
        notes += [f"{table.name} has a column {name}, which says nothing to legfem: is it {meant}?" for meant in near]
    for name in ("group", "sex"):
        given = pd.DataFrame({"who": [one.person for one in members], name: [one.given.get(name) for one in members]})
        several = given.dropna().groupby("who")[name].nunique()
        if changed := [str(who) for who in several.index[several > 1]]:
            notes.append(f"{table.name}: {', '.join(changed[:5])} ({len(changed)}) has more than one {name}.")
    sexes = sorted({str(one.given["sex"]) for one in members if "sex" in one.given})
    if len(sexes) > 2:
        notes.append(f"{table.name}: sex is one of {', '.join(sexes[:5])}: write each in one way.")
    sides = {str(one.given.get("side", "")) for one in members} - {"", *_SIDES.values()}
    if sides:
        notes.append(f"{table.name}: side is neither left nor right, but {', '.join(sorted(sides))}.")
    return notes


def _problem(path: Path, written: str, found: Mapping[str, Path], files: Sequence[str]) -> str:
    try:
        if any((path / file).is_file() for file in files):
            return ""
        there_is = path.is_dir()
    except OSError as error:  # what no path can be called
        return f"folder '{written[:80]}' can't be looked at ({str(error.strerror).lower()}); check its name"
    there = {name.lower(): name for name in found}
    near = difflib.get_close_matches(written.lower(), there, n=1)
    hint = f"did you mean '{there[near[0]]}'?" if near else "check its name"
    what = f"contains no {' or '.join(files)}" if there_is else "is not there"
    return f"folder '{written}' {what}; {hint}"


def cells_of(table: Path) -> pd.DataFrame:
    """Texts of a table by its lower-case column names; the index is the line."""
    if not table.is_file():
        raise InputError(table, "file", "not found", "check the path")
    if table.suffix.lower() not in (".csv", ".txt", ".tsv", ".xlsx"):
        raise InputError(table, "file", "is neither CSV nor .xlsx", "save it as one of them")
    try:
        cells = _workbook_cells(table) if table.suffix.lower() == ".xlsx" else _text_cells(table)
    except InputError:
        raise
    except Exception as error:  # whatever a library meets in a damaged file
        said = " ".join(str(error).split())[:120]
        raise InputError(table, "file", f"can't be read ({said})", "save it as CSV or .xlsx again") from None
    cells = cells.fillna("").map(lambda cell: str(cell).strip())
    header, cells = cells.iloc[0], cells.iloc[1:]
    for number, name in enumerate(header):
        if not name and (cells[number] != "").any():
            remedy = "name it, or remove it; the first row is the header"
            raise InputError(table, "header", f"column {number + 1} has no name", remedy)
    cells = cells[[number for number, name in enumerate(header) if name]]
    lower = [name.lower() if name.lower() in _KNOWN else name for name in header if name]
    if twice := sorted({name for name in lower if lower.count(name) > 1}):
        raise InputError(table, "header", f"column '{twice[0]}' is there twice", "rename one")
    cells = cells.set_axis(lower, axis=1).set_axis(range(2, len(cells) + 2), axis=0)
    cells = cells[(cells != "").any(axis=1)]
    if cells.empty:
        raise InputError(table, "rows", "there are none", "add them below the header")
    return cells


def _text_cells(table: Path) -> pd.DataFrame:
    """Cells of a text, its header first."""
    text = read_text(table, "check the path", "save it as CSV UTF-8")
    first = text.partition("\n")[0]
    mark = next((mark for mark in ";\t" if mark in first), ",")
    rows = list(csv.reader(StringIO(text), delimiter=mark, strict=True))
    if not any(rows):
        raise InputError(table, "file", "is empty", "write a header, and rows below it")
    width = len(rows[0])
    for line, row in enumerate(rows, 1):
        if len(row) != width and any(map(str.strip, row)):
            remedy = "quote texts with separators, and separate empty cells, too"
            raise InputError(table, f"line {line}", f"has {len(row)} cells, and the header {width}", remedy)
    return pd.read_csv(StringIO(text), sep=mark, dtype=str, header=None, names=range(width), skip_blank_lines=False)


def _workbook_cells(table: Path) -> pd.DataFrame:
    """Cells of a workbook, its header first; merged ones, of which all but the first are empty, are refused."""
    from openpyxl import load_workbook

    merged = next(iter(load_workbook(table).worksheets[0].merged_cells.ranges), None)
    if merged is not None:
        raise InputError(table, f"cells {merged}", "are merged", "split them, and fill each")
    cells = pd.read_excel(table, dtype=str, header=None)
    if cells.empty:
        raise InputError(table, "file", "is empty", "write a header, and rows below it")
    return cells


def _as_numbers(column: "pd.Series[str]", name: str) -> list[float] | None:
    """A column's numbers, NaN where it is empty; None where one is a text, or the column is of texts."""
    if name in (*DESIGN, "folder", "sex"):
        return None
    values = plain_numbers(column)
    return None if (values.isna() & (column != "")).any() or values.isna().all() else [float(v) for v in values]


def plain_numbers(column: "pd.Series[str]") -> "pd.Series[float]":
    """Numbers of a column, with a point or a comma; NaN where there is none."""
    return pd.to_numeric(column.str.replace(r"^([+-]?\d+),(\d+)$", r"\1.\2", regex=True), errors="coerce")


def _check_date(table: Path, line: int, text: str) -> None:
    if not text:
        return
    try:
        datetime.fromisoformat(text)
    except ValueError:
        raise InputError(table, f"date, line {line}", f"'{text}' is not a date", "write 2026-01-31") from None

"""Files as five instruments' programs may write them, by dialect after dialect: none is read wrong, most are read."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random

import numpy as np
import pytest
from making import press
from openpyxl import Workbook

from legfem.common.errors import InputError
from legfem.data import Recording
from legfem.data.columns import propose
from legfem.data.formats import read_sheets
from legfem.data.recording import recording_of

MADE = press(air=2.0, hold=5.0, force_sd=0.02, displacement_sd=0.005, offset=0.1, seed=4)
UNITS = {
    "time": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "min": 60.0},
    "displacement": {"mm": 1.0, "µm": 1e-3, "cm": 10.0, "m": 1e3, "in": 25.4},
    "force": {"N": 1.0, "mN": 1e-3, "kN": 1e3, "kgf": 9.80665, "lbf": 4.4482216152605},
}


@dataclass(frozen=True)
class Instrument:
    """How one program names what it records, parts its cells, and says units."""

    names: dict[str, Sequence[str]]
    head: Sequence[str]
    delimiters: str
    decimals: str
    units: Sequence[str]
    """``row`` of their own, in brackets (``own``) there, or behind the names in ``(``, ``[`` or after ``_``."""
    forms: Sequence[str] = ("csv", "txt")
    extra: Sequence[tuple[str, str]] = (("Temperature", "°C"), ("Cycle", "count"))


ENGLISH = {
    "time": ["Time", "Elapsed Time", "Running Time"],
    "displacement": ["Extension", "Crosshead", "Axial Displacement", "Position"],
    "force": ["Load", "Force", "Axial Force"],
}
GERMAN = {
    "time": ["Prüfzeit", "Zeit"],
    "displacement": ["Standardweg", "Traversenweg", "Verschiebung"],
    "force": ["Kraft", "Standardkraft", "Last"],
}
FRENCH = {"time": ["Temps"], "displacement": ["Déplacement"], "force": ["Force", "Force axiale"]}
INSTRUMENTS = {
    "Bluehill": Instrument(ENGLISH, ["Specimen label", "Rate 1"], ",;", ".,", ["own", "("], extra=[("Cycle", "count")]),
    "TestSuite": Instrument(ENGLISH, ["Test Name:", "Test Run Name:"], ",\t", ".", ["row"], ("csv", "txt", "dat")),
    "testXpert": Instrument(GERMAN, ["Prüfer", "Probe"], ";\t", ",.", ["row", "["], ("TRA", "txt", "csv", "xlsx")),
    "WinTest": Instrument(ENGLISH, ["WinTest Data File"], ",", ".", ["row"], ("txt", "csv", "")),
    "a logger": Instrument(
        FRENCH | ENGLISH, ["# logger", "rate"], ",;\t", ".,", ["(", "[", "_"], ("csv", "xlsx", "zip")
    ),
}


@dataclass(frozen=True)
class Dialect:
    """One file: what was drawn of how it is written."""

    instrument: str
    names: tuple[str, str, str]
    units: tuple[str, str, str]
    style: str
    form: str
    delimiter: str
    decimal: str
    signs: tuple[int, int]
    zero: float
    order: tuple[int, ...]
    quoted: bool
    thousands: bool
    encoding: str
    line: str
    head: int
    meta: bool
    foot: bool
    extra: int
    text: bool
    empty: bool
    doubled: bool
    trailing: bool
    digits: int


def drawn(seed: int) -> Dialect:
    """A dialect; the same for the same seed."""
    draw = Random(seed)
    name = draw.choice(sorted(INSTRUMENTS))
    one = INSTRUMENTS[name]
    decimal, delimiter = draw.choice(one.decimals), draw.choice(one.delimiters)
    quoted = delimiter == decimal or coin(draw)
    return Dialect(
        instrument=name,
        names=tuple(draw.choice(one.names[q]) for q in UNITS),
        units=tuple(draw.choice(sorted(UNITS[q])) for q in UNITS),
        style=draw.choice(one.units),
        form=draw.choice(one.forms),
        delimiter=delimiter,
        decimal=decimal,
        signs=(draw.choice([1, -1]), draw.choice([1, -1])),
        zero=draw.choice([0.0, 50.0, -3.0]),
        order=tuple(draw.sample(range(3), 3)),
        quoted=quoted,
        thousands=quoted and coin(draw),
        encoding=draw.choice(["utf-8", "utf-8-sig", "cp1252", "utf-16"]),
        line=draw.choice(["\n", "\r\n"]),
        head=draw.randint(0, 5),
        meta=coin(draw),
        foot=coin(draw),
        extra=draw.randint(0, 2),
        text=coin(draw),
        empty=coin(draw),
        doubled=coin(draw),
        trailing=coin(draw),
        digits=draw.randint(6, 9),
    )


def coin(draw: Random) -> bool:
    return draw.random() < 0.5


def _columns(one: Dialect) -> list[tuple[str, str, list[float | str]]]:
    """Name, unit and cells of each column in the file's order."""
    values = [MADE.time, one.signs[0] * MADE.displacement + one.zero, one.signs[1] * MADE.force]
    factors = [UNITS[q][u] for q, u in zip(UNITS, one.units, strict=True)]
    found = []
    for k in one.order:
        cells = (values[k] / factors[k]).tolist()
        found.append((one.names[k], one.units[k], cells[:1] * one.doubled + cells))
    rows = len(found[0][2])
    for k, (name, unit) in enumerate(INSTRUMENTS[one.instrument].extra[: one.extra]):
        found.insert(k * 2, (name, unit, [20.0 + k] * rows))
    if one.text:
        found.append(("State", "", [f"RUN-{k % 5}" for k in range(rows)]))
    if one.empty:
        found.insert(1, ("Spare", "", [""] * rows))
    return found


def _grid(one: Dialect) -> list[list[str | float]]:
    """Rows of cells: heading, names, units, samples, and what stands below."""
    columns = _columns(one)
    head = [[label, f"value {k}"] for k, label in enumerate(INSTRUMENTS[one.instrument].head * 3)][: one.head]
    behind = {"(": "{} ({})", "[": "{} [{}]", "_": "{}_{}"}.get(one.style, "{}")
    names = [behind.format(name, unit) if unit else name for name, unit, _ in columns]
    rows: list[list[str | float]] = [*head, names]
    if one.style in ("row", "own"):
        rows.append([(f"({unit})" if one.style == "own" and unit else unit) for _, unit, _ in columns])
        if one.meta:
            rows.append(["none" for _ in columns])
    rows += [list(row) for row in zip(*(cells for _, _, cells in columns), strict=True)]
    return rows + ([["end of test"]] if one.foot else [])


def _cell(one: Dialect, value: str | float) -> str:
    if isinstance(value, str):
        return f'"{value}"' if one.quoted and value else value
    text = f"{value:{',' if one.thousands else ''}.{one.digits}f}"
    if one.decimal == ",":
        text = text.translate(str.maketrans(",.", ".,"))
    return f'"{text}"' if one.quoted else text


def write(one: Dialect, folder: Path) -> Path:
    rows = _grid(one)
    if one.form == "xlsx":
        book = Workbook()
        for row in rows:
            book.active.append(row)
        book.save(folder / "made.xlsx")
        return folder / "made.xlsx"
    end = (one.delimiter if one.trailing else "") + one.line
    text = "".join(one.delimiter.join(_cell(one, cell) for cell in row) + end for row in rows)
    path = folder / ("made.csv" if one.form == "zip" else f"made.{one.form}".rstrip("."))
    path.write_bytes(text.encode(one.encoding, errors="replace"))
    if one.form == "zip":
        with zipfile.ZipFile(folder / "made.zip", "w") as archive:
            archive.write(path, path.name)
        return folder / "made.zip"
    return path


def wrong(read: Recording) -> str:
    """What is wrong with a reading; nothing where it is right."""
    if len(read) != len(MADE):
        return f"{len(read)} samples of {len(MADE)}"
    away = read.displacement - read.displacement[0] - (MADE.displacement - MADE.displacement[0])
    for name, off in (("time", read.time - MADE.time), ("displacement", away), ("force", read.force - MADE.force)):
        if np.abs(off).max() > 0.02:
            return f"{name} is off by {np.abs(off).max():.3g}"
    return ""


def is_read(folder: Path, one: Dialect) -> bool:
    """Write and read a file: False where it is refused, and never read wrong."""
    path = write(one, folder)
    try:
        sheets = read_sheets(path)
        found = propose(path, sheets)
        reading = recording_of(path, sheets, found.channels)
    except InputError as error:
        assert "\n" not in str(error) and error.remedy
        print("refused", str(error)[len(str(path)) :][:230], one, sep=" | ")
        return False
    assert not (problem := wrong(reading)), (problem, one)
    return True


@pytest.mark.parametrize("drawings", [range(40), pytest.param(range(40, 600), marks=pytest.mark.slow)], ids=len)
def test_of_many_dialects_none_is_read_wrong_and_nearly_all_are_read(tmp_path: Path, drawings: range) -> None:
    read = [is_read(tmp_path, drawn(seed)) for seed in drawings]
    print(f"{sum(read)} of {len(read)} dialects are read, none of them wrong")
    assert sum(read) >= 0.95 * len(read)

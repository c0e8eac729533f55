"""Good files of many kinds, what reads each, and damage by a seed: of transfers, spreadsheets, programs and people."""

from __future__ import annotations

import gzip
import io
import json
import re
import tomllib
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from making_lab_files import TEXTS
from making_odd_files import D, F, T
from test_frames_exported import FILMS, PULL, READ, named
from test_labs_second_exports import EXPORTS, TOML

from legfem.app.study import members_of
from legfem.app.workspace import Workspace
from legfem.channels.kind import Face
from legfem.channels.kinds import CHANNELS
from legfem.cohort.members import find_members
from legfem.cohort.readings import read_readings
from legfem.data import segment
from legfem.data.channel_reader import ChannelsEntry, SpecimenChannelsEntry, read_channel, with_channels
from legfem.data.columns import propose
from legfem.data.formats import read_sheets
from legfem.data.plausibility import magnitude_doubts, trial_doubts
from legfem.data.quality import quality_of
from legfem.data.recording import recording_of
from legfem.geometry.indenter import Site
from legfem.inverse.population import read_cohort_population
from legfem.specimens.folder import load_specimen

type Damage = Callable[[np.random.Generator, bytes], bytes]


@dataclass(frozen=True)
class Found:
    """What was read, as numbers and texts, and what was said of it."""

    values: tuple[Any, ...]
    said: tuple[str, ...] = ()


@dataclass(frozen=True)
class Kind:
    """Good files of one kind by name, and what reads a folder of them."""

    files: Mapping[str, Mapping[str, bytes]]
    read: Callable[[Path, str], Found]
    untouched: tuple[str, ...] = ()
    """Endings of files that aren't broken."""
    others: tuple[Damage, ...] = ()
    """Damage that makes another good file of one: what it loses nobody can see in it."""


def _bytes(content: str | bytes) -> bytes:
    return content.encode() if isinstance(content, str) else content


def _recording(folder: Path, name: str) -> Found:
    (path,) = folder.iterdir()
    sheets = read_sheets(path)
    proposal = propose(path, sheets)
    recording = recording_of(path, sheets, proposal.channels)
    trial = segment(recording)
    doubts = (*magnitude_doubts(trial), *trial_doubts([trial]))
    reasons = [why for _, why in quality_of(trial).judged]
    values = recording.time, recording.displacement, recording.force
    return Found(values, (*map(str, doubts), *reasons, *proposal.reasons))


def _twist(folder: Path, name: str) -> Found:
    found = load_specimen(folder)
    left = [f"{one.name}: {one.reason}" for one in found.left_out]
    values = [
        v for one in found.recordings for v in (one.recording.time, one.recording.displacement, one.recording.force)
    ]
    return Found(tuple(values), (*map(str, found.doubts), *left))


def _field(folder: Path, name: str) -> Found:
    files, entry, _ = READ[name]
    given = SpecimenChannelsEntry.model_validate(tomllib.loads(f"[face_strain]\n{named(files)}{entry}\n"))
    (recording,) = with_channels(folder / "specimen.toml", given, [PULL], [Face(5.0, 5.0)])
    (one,) = recording.channels
    return Found((one.time, one.values, one.course))


def _film(site: Site) -> Callable[[Path, str], Found]:
    def read(folder: Path, name: str) -> Found:
        files, entry, _ = FILMS[name]
        given = ChannelsEntry.model_validate(tomllib.loads(f"[contact_pressure]\n{named(files)}{entry}\n"))
        (recording,) = with_channels(folder / "subject.toml", given, [PULL], site)
        (one,) = recording.channels
        left = tuple(f"{n} {why}" for why, n in one.left_out.items() if n and why != "threshold")
        return Found((one.time, one.values, one.course), left)

    return read


def _channel(folder: Path, name: str) -> Found:
    return Found(read_channel(folder / "fat.csv", CHANNELS["fat_thickness"]))


def _study(folder: Path, name: str) -> Found:
    found = find_members(folder, "identify")
    return Found(tuple(f"{one.name} {sorted(one.given.items())} {one.problem}" for one in found.every), found.notes)


def _readings(folder: Path, name: str) -> Found:
    (path,) = folder.iterdir()
    found = read_readings(path)
    return Found(tuple(map(repr, found.parameters)), found.not_done)


def _app(folder: Path, name: str) -> Found:
    text = (folder / "study.csv").read_bytes().decode("utf-8", errors="replace")
    found = members_of(Workspace(folder), text)
    return Found(tuple(f"{one.name} {sorted(one.given.items())}" for one in found.every), found.notes)


def _population(folder: Path, name: str) -> Found:
    return Found((repr(read_cohort_population(folder / "population.json")),))


def _book(frame: pd.DataFrame, **how: Any) -> bytes:
    file = io.BytesIO()
    frame.to_excel(file, index=False, **how)
    return file.getvalue()


PRESSED = pd.DataFrame({"Time (s)": T, "Position (mm)": D, "Force (N)": F})
STUDY = "folder,subject,group,side,session,date,age\n" + "".join(
    f"leg{k},P{k // 2},{'ab'[k // 2 % 2]},{('left', 'right')[k % 2]},1,2026-0{k + 1}-03,{30 + k // 2}\n"
    for k in range(8)
)
READINGS = "member,side,visit,value (N/m),error\n" + "".join(
    f"P{k // 4},{('left', 'right')[k // 2 % 2]},{k % 2 + 1},{250 + 7 * (k % 5)}.5,4.0\n" for k in range(32)
)
FAT = "time_s,fat_thickness_mm\n" + "".join(f"{t:.1f},{9 - 0.3 * t:.2f}\n" for t in np.arange(0.0, 6.0, 0.5))
POPULATION = {
    "schema_version": 1,
    "parameters": {"c10_deep": {"median": 0.8, "log_sd": 0.3, "people": 40, "law": "neo-hookean", "source": "study"}},
}


def _legs(folder: Path) -> dict[str, bytes]:
    return {f"{folder}leg{k}/subject.toml": b'id = "x"\n' for k in range(8)}


def kinds(site: Site) -> dict[str, Kind]:
    """Return every kind; films lie on a site's cylinder."""
    texts = {name: {"a.txt": _bytes(one)} for name, one in TEXTS.items() if isinstance(one, str | bytes)}
    frames = {name: {file: _bytes(c) for file, c in of[0].items()} for name, of in READ.items()}
    films = {name: {file: _bytes(c) for file, c in of[0].items()} for name, of in FILMS.items()}
    books = {"one sheet": {"a.xlsx": _book(PRESSED)}, "named": {"a.xlsx": _book(PRESSED, sheet_name="Probe 1")}}
    twisted = {"specimen.toml": TOML.encode()}
    rheometers = {
        name: {f"recordings/{name}": c.encode("cp1252" if name.endswith("txt") else "utf-8"), **twisted}
        for name, c in EXPORTS.items()
    }
    book = _book(pd.read_csv(io.StringIO(STUDY)))
    toml, tables, rows = (".toml",), (_stuck, _column), (_reversed, _headless, _unit, _cut)
    table = PRESSED.to_csv(index=False).encode()
    plain = {"a table": {"a.csv": table}, "packed": {"a.csv.gz": gzip.compress(table)}}
    return {
        "fields": Kind(frames, _field, others=(_stuck,)),
        "films": Kind(films, _film(site), others=(_stuck, _thousands, _reversed)),
        "rheometers": Kind(rheometers, _twist, (".toml",)),
        "instruments": Kind(texts, _recording),
        "workbooks": Kind(books, _recording),
        "tables": Kind(plain, _recording),
        "channels": Kind({"fat": {"fat.csv": FAT.encode()}}, _channel, others=(_stuck,)),
        "studies": Kind({"eight legs": {"cohort.csv": STUDY.encode(), **_legs("")}}, _study, toml, tables),
        "studies' books": Kind({"eight legs": {"cohort.xlsx": book, **_legs("")}}, _study, toml, tables),
        "readings": Kind({"a probe": {"r.csv": READINGS.encode()}}, _readings, others=(*tables, *rows)),
        "the app's tables": Kind({"study": {"study.csv": STUDY.encode(), **_legs("inputs/")}}, _app, toml, tables),
        "populations": Kind({"one": {"population.json": json.dumps(POPULATION).encode()}}, _population),
    }


def _cut(rng: np.random.Generator, content: bytes) -> bytes:
    """A file that ends early, though not within a number: nobody can see that one has lost its last digits."""
    end = int(rng.integers(len(content)))
    while b"\0" not in content and end < len(content) and content[end : end + 1] in b"0123456789.":
        end += 1
    return content[:end]


def _bits(rng: np.random.Generator, content: bytes) -> bytes:
    kept = bytearray(content)
    for at in rng.integers(len(kept), size=int(rng.integers(1, 6))):
        kept[at] ^= 1 << int(rng.integers(8))
    return bytes(kept)


def _nothing(rng: np.random.Generator, content: bytes) -> bytes:
    return b""


def _zeros(rng: np.random.Generator, content: bytes) -> bytes:
    """A disk that lost the end of a file, whose length stayed."""
    at = int(rng.integers(len(content)))
    return content[:at] + bytes(len(content) - at)


def _page(rng: np.random.Generator, content: bytes) -> bytes:
    return b"<!DOCTYPE html><html><head><title>Sign in</title></head><body>Please sign in</body></html>\n"


def _pointer(rng: np.random.Generator, content: bytes) -> bytes:
    return b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a214614ab\nsize 12345\n"


def _merged(rng: np.random.Generator, content: bytes) -> bytes:
    lines = content.split(b"\n")
    at = int(rng.integers(1, max(len(lines), 2)))
    mine = [b"<<<<<<< HEAD", *lines[at : at + 2], b"=======", *lines[at : at + 1], b">>>>>>> other"]
    return b"\n".join([*lines[:at], *mine, *lines[at + 2 :]])


def _twice(rng: np.random.Generator, content: bytes) -> bytes:
    """A program that appends to the file of the test before."""
    return content + b"\n" + content


def _another(rng: np.random.Generator, content: bytes) -> bytes:
    """Another kind of file under its name."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("mimetype", "application/epub+zip")
    return [file.getvalue(), b"%PDF-1.7\n1 0 obj\n<<>>\nendobj\n", b"\x89PNG\r\n\x1a\n" + bytes(40)][
        int(rng.integers(3))
    ]


WHOLE: tuple[Damage, ...] = (_cut, _bits, _nothing, _zeros, _page, _pointer, _twice, _another)
_NUMBER = re.compile(rb"(?<![\w.])-?\d+[.,]?\d*(?:e[+-]?\d+)?(?![\w])", re.IGNORECASE)
_CELLS = (b"#REF!", b"#DIV/0!", b"1e999", b"OVLD", b"---", b"n.d.", b"1.2.3", b"12:61", b"\xff\xfe", b"'", b'"', b"\t")


def _cell(rng: np.random.Generator, content: bytes) -> bytes:
    numbers = list(_NUMBER.finditer(content))
    if not numbers:
        return content[::-1]
    one = numbers[int(rng.integers(len(numbers)))]
    return content[: one.start()] + _CELLS[int(rng.integers(len(_CELLS)))] + content[one.end() :]


def _mark(content: bytes) -> bytes:
    """What parts cells."""
    return next((mark for mark in (b"\t", b";") if mark in content), b",")


def _row(rng: np.random.Generator, content: bytes) -> bytes:
    """A row that has lost its end, as one that was written when the program was ended."""
    lines, mark = content.split(b"\n"), _mark(content)
    long = [k for k, line in enumerate(lines) if line.count(mark)]
    if long:
        at = long[int(rng.integers(len(long)))]
        lines[at] = mark.join(lines[at].split(mark)[: int(rng.integers(1, lines[at].count(mark) + 1))])
    return b"\n".join(lines)


def _headless(rng: np.random.Generator, content: bytes) -> bytes:
    lines = content.split(b"\n")
    del lines[int(rng.integers(min(len(lines), 6)))]
    return b"\n".join(lines)


def _reversed(rng: np.random.Generator, content: bytes) -> bytes:
    lines = content.rstrip(b"\n").split(b"\n")
    half = len(lines) // 4 + 1
    return b"\n".join([*lines[:half], *lines[half:][::-1]]) + b"\n"


def _other_marks(rng: np.random.Generator, content: bytes) -> bytes:
    """Decimal commas by a spreadsheet, whatever separates cells."""
    return re.sub(rb"(\d)\.(\d)", rb"\1,\2", content)


def _thousands(rng: np.random.Generator, content: bytes) -> bytes:
    return re.sub(rb"(\d)\.(\d{3,})", rb"\1\2", content)


def _unit(rng: np.random.Generator, content: bytes) -> bytes:
    units = list(re.finditer(rb"\b(mm|s|N|kPa|px|Pa|sec|m)\b", content))
    if not units:
        return content[1:]
    one = units[int(rng.integers(len(units)))]
    return content[: one.start()] + [b"furlong", b"??", b"", b"kg", b"V"][int(rng.integers(5))] + content[one.end() :]


def _column(rng: np.random.Generator, content: bytes) -> bytes:
    """One cell of every line is gone: a column deleted, its heading with it or not."""
    lines = content.split(b"\n")
    mark = _mark(content)
    kept = int(rng.integers(2))
    gone = int(rng.integers(4))
    cells = [line.split(mark) for line in lines]
    made = [
        own if len(own) < 2 or k < kept else [c for j, c in enumerate(own) if j != gone] for k, own in enumerate(cells)
    ]
    return b"\n".join(mark.join(own) for own in made)


def _stuck(rng: np.random.Generator, content: bytes) -> bytes:
    """A sensor that was not connected: the last cell of every line is that of the third one."""
    lines = content.split(b"\n")
    mark = _mark(content)
    cells = [line.rsplit(mark, 1) for line in lines]
    long = [k for k, own in enumerate(cells) if len(own) == 2 and _NUMBER.fullmatch(own[1].strip())]
    if not long:
        return content[: len(content) // 2]
    value = cells[long[len(long) // 2]][1]
    return b"\n".join(mark.join([own[0], value]) if k in set(long) else mark.join(own) for k, own in enumerate(cells))


IN_TEXT: tuple[Damage, ...] = (
    *(_cell, _row, _headless, _reversed, _other_marks, _thousands, _unit, _column, _stuck, _merged),
)


def damaged(folder: Path, kind: Kind, rng: np.random.Generator) -> str:
    """Break one file of a folder; return which, and by what."""
    files = sorted(one for one in folder.rglob("*") if one.is_file() and one.suffix not in kind.untouched)
    path = files[int(rng.integers(len(files)))]
    content = path.read_bytes()
    binary = b"\0" in content[:2000] or content[:2] in (b"\x1f\x8b", b"PK")
    ways = [one for one in (WHOLE if binary or rng.random() < 0.25 else IN_TEXT) if one not in kind.others]
    way = ways[int(rng.integers(len(ways)))]
    path.write_bytes(way(rng, content))
    return f"{path.name} {way.__name__}"

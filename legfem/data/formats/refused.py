"""Files that are refused: force curves of atomic force microscopes, and what is called like a table and holds none.

A force curve has a piezo's height and a lever's deflection, often without a clock, and its tip has a radius of
nanometres: none of legfem's tests. Read by its columns' names alone it would pass for one.
"""

import re
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from legfem.common.errors import InputError
from legfem.common.resources import resource

_TABLES = resource("refused", dict[str, dict[str, Any]])
_BEGIN = re.compile(rb"\\\*(Force )?[Ff]ile list")
"""Bruker's, whose endings are numbers."""
_HEADING = re.compile(
    rb"atomic force|\bAFM\b|afmformats|force[- ](distance|volume|curve|spectroscopy)|inv_?OLS|\bT-B\b|Z-Sense"
    rb"|Z-detector|[vh]Deflection|deflection sensitivity|springConstant|cantilever[ _]spring|\bDFL\b",
    re.IGNORECASE,
)
_NAMED = re.compile(r"(?<![A-Za-z])(DFL|Curve_DFL|F-?D[_ -]?curve|force[_ -]?curve)(?![a-z])", re.IGNORECASE)
"""Files whose columns have no names, as NT-MDT's ``gel_Curve_DFL_Height_5.txt``."""
_READ_BYTES = 6000


def refuse_force_curve(path: Path) -> None:
    """Check that a file is no force curve of an atomic force microscope.

    Raises
    ------
    InputError
        If it is, with the program that wrote it, where that is known.
    """
    whose = _TABLES["endings"].get(path.suffix.lower())
    with path.open("rb") as file:
        begin = file.read(_READ_BYTES)
    if whose is None and _BEGIN.match(begin):
        whose = "Bruker's"
    if whose is None and begin.startswith(b"PK\x03\x04") and _holds_jpk(path):
        whose = "JPK's"
    if whose is None and (_holds_curves(path) if begin.startswith(b"\x89HDF") else _says_so(begin)):
        whose = "by its heading"
    if whose is None and _NAMED.search(path.stem) and re.match(rb"[\d\s.,;+-]{40}", begin):
        whose = "by its name, as NT-MDT's"
    if whose is not None:
        problem = f"is a force curve of an atomic force microscope ({whose}), which is not one of legfem's tests"
        ball = "if a ball of known diameter pressed a specimen"
        raise InputError(path, "file", problem, f"{ball}, export Time (s), Indentation (nm) and Force (nN) as CSV")


def _says_so(begin: bytes) -> bool:
    """Tell whether the heading of a text, as far as its tenth row of numbers, speaks of a microscope."""
    if b"\0" in begin:
        return False
    lines = begin.splitlines()
    numbers = [k for k, line in enumerate(lines) if re.fullmatch(rb'[\d\s.,;eE+"-]+', line) and line.strip()]
    return any(_HEADING.search(line) for line in lines[: numbers[0] if numbers else None])


def _holds_jpk(path: Path) -> bool:
    try:
        with zipfile.ZipFile(path) as archive, archive.open("header.properties") as file:
            return b"jpk" in file.read(_READ_BYTES)
    except (KeyError, zipfile.BadZipFile, NotImplementedError, RuntimeError):
        return False


def _holds_curves(path: Path) -> bool:
    """Tell whether an HDF5 file's attributes, or those of its groups, speak of a microscope."""
    import h5py

    try:
        with h5py.File(path) as file:
            of = [file, *(file[name] for name in list(file)[:10])]
            told = " ".join(f"{key} {value}" for one in of for key, value in one.attrs.items())
    except (OSError, KeyError, RuntimeError):
        return False
    return _HEADING.search(told.encode()) is not None


_ASKED = "with file = \"its name\" in the folder's .toml: what it doesn't say of place and time is asked for then"
_FILM = re.compile(rb'SECONDS_PER_FRAME|^"?SENSELS|^"?Frame:?[ ,]+\d+,*\r?$|\A.*(XSENSOR|pliance|pedar)', re.I | re.M)


def refuse_other_kind(path: Path, names: Sequence[str], kinds: Sequence[str] = ()) -> None:
    """Check that columns, or a heading, are those of no other kind of test, nor a field's.

    Parameters
    ----------
    path
        The file.
    names
        Of the columns, and what their units measure in angle brackets; or a heading's lines.
    kinds
        Which of those in ``resources/refused.toml`` are looked for; all, unless given.

    Raises
    ------
    InputError
        If they are, with what to export.
    """
    for kind, known in _TABLES["kinds"].items():
        asked = not kinds or kind in kinds
        if asked and re.search(known["columns"], "\n".join(names), re.IGNORECASE | re.MULTILINE):
            raise InputError(path, "columns", f"are {known['are']}", known["remedy"])


_AS_CSV = "export the numbers as CSV from the program that made it"
_UNPACK = "unpack it, and give the file in it"
_BEGINS, _PACKED = (
    {mark.encode("latin-1"): told for mark, told in _TABLES[name].items()} for name in ("begins", "packed")
)
_IN_ARCHIVES: dict[str, tuple[str, str]] = _TABLES["archives"]
_OLD_OFFICE = b"\xd0\xcf\x11\xe0"


_TRIOS = b"TRIOSJSONExportSchema"


def is_trios(path: Path) -> bool:
    """Tell whether a file is what TRIOS, a rheometer's program, writes as JSON."""
    with path.open("rb") as file:
        return path.suffix.lower() == ".json" and _TRIOS in file.read(_READ_BYTES)


def refuse_what_holds_no_table(path: Path) -> None:
    """Check that a file isn't of a kind that holds no table.

    Raises
    ------
    InputError
        If it is, with what it is and what to do.
    """
    with path.open("rb") as file:
        begin = file.read(_READ_BYTES)
    told = next((told for mark, told in _BEGINS.items() if begin.startswith(mark)), None)
    told = told or _packed(begin, path.suffix.lower()) or _marked_up(begin) or _of_office(path, begin)
    if told is None and _FILM.search(begin):
        told = "a pressure film's frames, and no recording", f"give [channels.contact_pressure] {_ASKED}"
    if begin[257:262] == b"ustar":
        told = "an archive (tar)", _UNPACK
    if told is not None:
        raise InputError(path, "file", f"is {told[0]}", told[1])


def _packed(begin: bytes, ending: str) -> tuple[str, str] | None:
    kind = next((kind for mark, kind in _PACKED.items() if begin.startswith(mark)), None)
    if kind is None or ending == f".{kind}":
        return None
    return f"packed ({kind}) and called {ending or 'without an ending'}", f"unpack it, or add .{kind} to its name"


def _marked_up(begin: bytes) -> tuple[str, str] | None:
    """Return what a text in a markup is: a web page, XML or JSON."""
    text = begin.removeprefix(b"\xef\xbb\xbf").lstrip().lower()
    if b"urn:schemas-microsoft-com:office:spreadsheet" in text:
        return "a workbook in Excel's XML of 2003", "open it in a spreadsheet, and save it as .xlsx"
    if text.startswith((b"<!doctype html", b"<html", b"<table", b"<meta", b"<head")):
        if b"<td" in text:
            return "a web page with a table", "open it in a spreadsheet, and save it as .xlsx"
        return "a web page, perhaps of a sign-in or an error", "download the file again"
    if text.startswith(b"<?xml"):
        return "XML", _AS_CSV
    if text.startswith(b"{") and b"docs.google.com" in text:
        return "a link to a Google document", "download the sheet as .xlsx or CSV"
    if re.match(rb'\{\s*"|\[\s*[\[{]', text) and _TRIOS.lower() not in text:
        return "JSON", "save as CSV: time, displacement and force, or angle and torque (an oscillation's G' is no test)"
    return None


def _of_office(path: Path, begin: bytes) -> tuple[str, str] | None:
    """Return what a file of an office program is that is no workbook, or a locked one."""
    if begin.startswith(_OLD_OFFICE):
        content = path.read_bytes()
        if "EncryptedPackage".encode("utf-16-le") in content:
            return "a workbook with a password", "save it without one"
        return _IN_ARCHIVES["word/document.xml"] if "WordDocument".encode("utf-16-le") in content else None
    if not begin.startswith(b"PK\x03\x04"):
        return None
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
    except (zipfile.BadZipFile, NotImplementedError):
        return None
    names = {one.filename for one in members}
    if any(one.flag_bits & 1 for one in members):
        return "an archive with a password", _UNPACK
    if names and all(name.endswith(".npy") for name in names):
        return "an archive of NumPy's arrays", "save them as CSV with a line of names above the numbers"
    return next((told for name, told in _IN_ARCHIVES.items() if name in names), None)

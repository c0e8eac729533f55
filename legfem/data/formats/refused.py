"""Files that are refused: force curves of atomic force microscopes, and what is called like a table and holds none.

A force curve has a piezo's height and a lever's deflection, often without a clock, and its tip has a radius of
nanometres: none of legfem's tests. Read by its columns' names alone it would pass for one.
"""

import re
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path

from legfem.common.errors import InputError

_ENDINGS = {
    ".ibw": "Asylum Research's, by Igor",
    ".jpk-force": "JPK's",
    ".jpk-force-map": "JPK's",
    ".jpk-qi-data": "JPK's",
    ".jpk-qi-image": "JPK's",
    ".mdt": "NT-MDT's",
    ".nid": "Nanosurf's",
    ".pfc": "Bruker's",
    ".spm": "Bruker's",
}
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
    whose = _ENDINGS.get(path.suffix.lower())
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
        raise InputError(
            path,
            "file",
            f"is a force curve of an atomic force microscope ({whose}), which is not one of legfem's tests",
            "if a ball of known diameter pressed a specimen, export Time (s), Indentation (nm) and Force (nN) as CSV",
        )


def _says_so(begin: bytes) -> bool:
    """Tell whether the heading of a text, as far as its tenth row of numbers, speaks of a microscope."""
    if b"\0" in begin:
        return False
    lines = begin.splitlines()
    numbers = [k for k, line in enumerate(lines) if re.fullmatch(rb'[\d\s.,;eE+"-]+', line) and line.strip()]
    return any(_HEADING.search(line) for line in lines[: numbers[0] if numbers else None])


def _holds_jpk(path: Path) -> bool:
    try:
        with zipfile.ZipFile(path) as archive:
            if "header.properties" not in archive.namelist():
                return False
            with archive.open("header.properties") as file:
                return b"jpk" in file.read(_READ_BYTES)
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError):
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


_A_STEP = "export a step, a ramp or a hold: time, displacement or angle, and force or torque"
_ASKED = "with file = \"its name\" in the folder's .toml: what it doesn't say of place and time is asked for then"
BENDS = r"flexur|(three|four|3|4).?(point|punkt).?(bend|bieg)|\bbiege|durchbiegung"
_FIELD = r"^subset_id$|^[uv]_pi?x|^(eps|u|displ?(acement)?)_?[xy]$|^lambda.?1$|^u\nv$"
_LOSES = r"G''|G\"|G″|G´´|loss mod|verlustmod|verlustfaktor|loss factor|tan\W*(?:delta|δ)"
SWINGS = rf"^(?:oscillation|oszillation)\b|\A(?=(?s:.)*(?:{_LOSES}))(?s:.)*^(?:(?:angular )?freq|f$|omega|ω)"
OTHER_KINDS = {
    SWINGS: ("an oscillation's (G', G''), which is none of legfem's tests", _A_STEP),
    BENDS: ("a bending test's, which is none of legfem's", "press, pull or shear the specimen"),
    _LOSES: ("an oscillation's (G', G''), which is none of legfem's tests", _A_STEP),
    rf"\A(?!(?s:.)*(force|load|^f_?[xyz]$))(?s:.)*({_FIELD})": (
        "a camera's field of points, no recording's",
        f"give [channels.face_strain], or section_displacement, {_ASKED}",
    ),
    r"\A(?=(?s:.)*^<angle>$)(?s:.)*^<torque>$": (
        "an angle's and a torque's: a cylinder was twisted",
        "give [torsion] diameter_mm and height_mm in specimen.toml beside recordings/, which then reads them",
    ),
}
"""By a pattern of columns' names, a line each: what they are, and what to do."""
_FILM = re.compile(rb'SECONDS_PER_FRAME|^"?SENSELS|^"?Frame:?[ ,]+\d+,*\r?$|\A.*(XSENSOR|pliance|pedar)', re.I | re.M)


def refuse_other_kind(path: Path, names: Sequence[str], kinds: Iterable[str] = OTHER_KINDS) -> None:
    """Check that columns, or a heading, are those of no other kind of test, nor a field's.

    Parameters
    ----------
    path
        The file.
    names
        Of the columns, and what their units measure in angle brackets; or a heading's lines.
    kinds
        Which of `OTHER_KINDS` are looked for.

    Raises
    ------
    InputError
        If they are, with what to export.
    """
    for words in kinds:
        if re.search(words, "\n".join(names), re.IGNORECASE | re.MULTILINE):
            what, remedy = OTHER_KINDS[words]
            raise InputError(path, "columns", f"are {what}", remedy)


_AS_CSV = "export the numbers as CSV from the program that made it"
_UNPACK = "unpack it, and give the file in it"
_BEGINS: dict[bytes, tuple[str, str]] = {
    b"%PDF": ("a PDF", _AS_CSV),
    b"{\\rtf": ("formatted text (RTF)", "save it as plain text: in TextEdit, Format, Make Plain Text"),
    b"version https://git-lfs": ("a pointer of Git LFS in place of the file", "fetch the file: git lfs pull"),
    b"/annex/objects/": ("a pointer of git-annex in place of the file", "fetch the file: git annex get"),
    b"7z\xbc\xaf": ("an archive (7z)", _UNPACK),
    b"Rar!": ("an archive (RAR)", _UNPACK),
    b"\x89PNG": ("a picture (PNG)", _AS_CSV),
    b"\xff\xd8\xff": ("a picture (JPEG)", _AS_CSV),
    b"GIF8": ("a picture (GIF)", _AS_CSV),
    b"II*\0": ("a picture (TIFF)", _AS_CSV),
    b"MM\0*": ("a picture (TIFF)", _AS_CSV),
    b"PAR1": ("a Parquet file", "export it as CSV: in pandas, read_parquet and to_csv"),
    b"SQLite format 3": ("a database (SQLite)", "export the recording's table as CSV"),
    b"\x93NUMPY": (
        "a NumPy array, whose columns have no names",
        "save it as CSV with a line of names above the numbers",
    ),
    b"bplist00": ("a property list of macOS, perhaps what iCloud left of a file", "download the file in Finder"),
    b"\x80\x04\x95": ("a pickle of Python's", "save the table as CSV: in pandas, to_csv"),
}
_PACKED = {b"\x1f\x8b": "gz", b"BZh": "bz2", b"\xfd7zXZ": "xz"}
_IN_ARCHIVES = {
    "xl/workbook.bin": ("a binary workbook (.xlsb)", "save it as .xlsx"),
    "word/document.xml": ("a Word document", "save the table in it as CSV"),
    "ppt/presentation.xml": ("a PowerPoint presentation", _AS_CSV),
    "Index/Document.iwa": ("a workbook of Apple's Numbers", "export it as Excel or CSV: File, Export To"),
}
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

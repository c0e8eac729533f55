"""Files that are called like a table and hold none: told by how they begin, so that a refusal says what they are."""

import re
import zipfile
from pathlib import Path

from legfem.common.errors import InputError

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
_READ_BYTES = 4000


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
    if re.match(rb'\{\s*"|\[\s*[\[{]', text):
        return "JSON", "save it as CSV, a column each for time, displacement and force"
    return None


def _of_office(path: Path, begin: bytes) -> tuple[str, str] | None:
    """Return what a file of an office program is that is no workbook, or a locked one."""
    if begin.startswith(_OLD_OFFICE):
        content = path.read_bytes()
        if "EncryptedPackage".encode("utf-16-le") in content:
            return "a workbook with a password", "save it without one"
        return ("a Word document", "save the table in it as CSV") if _named(content, "WordDocument") else None
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


def _named(content: bytes, stream: str) -> bool:
    return stream.encode("utf-16-le") in content

"""Instruments' files: which reader reads what."""

import bz2
import gzip
import lzma
import tempfile
import zipfile
from collections.abc import Callable
from functools import lru_cache, partial
from importlib import import_module
from pathlib import Path, PurePath

from legfem.common.errors import InputError
from legfem.data.formats.refused import is_trios, refuse_force_curve, refuse_what_holds_no_table
from legfem.data.formats.sheet import MOST_BYTES, Column, Sheet, check_size, file_of
from legfem.data.formats.text import read_text

__all__ = ["READERS", "Column", "Sheet", "file_of", "read_sheets"]

type Reader = Callable[[Path], list[Sheet]]


def _reader(module: str, name: str) -> Reader:
    """Return a reader whose module, and the libraries that it takes, are loaded with the first file of its kind."""

    def read(path: Path) -> list[Sheet]:
        found: list[Sheet] = getattr(import_module(f"{__name__}.{module}"), name)(path)
        return found

    return read


_workbook, _old_workbook = _reader("workbook", "read_workbook"), _reader("workbook", "read_old_workbook")
_open_document = _reader("workbook", "read_open_document")
_tdms, _lvm = _reader("arrays", "read_tdms"), _reader("arrays", "read_lvm")
_trios = _reader("trios", "read_trios")
_matlab, _hdf5 = _reader("arrays", "read_matlab"), _reader("arrays", "read_hdf5")


def _zipped(path: Path) -> list[Sheet]:
    """Read the one file in an archive, or a workbook without its ending."""
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        if "[Content_Types].xml" in names:
            return _workbook(path)
        if "content.xml" in names:
            return _open_document(path)
        files = [one for one in archive.infolist() if not one.is_dir() and not is_litter(Path(one.filename))]
        files = [one for one in files if Path(one.filename).suffix.lower() in READERS] or files
        if len(files) != 1:
            few = ", ".join(one.filename for one in files[:4]) + (", ..." if len(files) > 4 else "")
            told = f"contains {len(files)} files ({few})" if files else "contains no files"
            raise InputError(path, "file", told, "unpack it, and look at one of them")
        check_size(path, files[0].file_size)
        return _read_within(path, Path(files[0].filename).name, archive.read(files[0]))


def _packed(path: Path) -> list[Sheet]:
    """Read the file that gzip, bzip2 or xz packed."""
    with _UNPACK[path.suffix.lower()](path) as file:
        content = bytes(file.read(MOST_BYTES + 1))
    check_size(path, len(content))
    return _read_within(path, path.stem, content)


def _read_within(path: Path, name: str, content: bytes) -> list[Sheet]:
    """Read a file out of the one that holds it."""
    with tempfile.TemporaryDirectory() as folder:
        inner = Path(folder) / name
        inner.write_bytes(content)
        try:
            refuse_force_curve(inner)
            if zipfile.is_zipfile(inner) and inner.suffix.lower() not in (".xlsx", ".xlsm"):
                raise InputError(inner, "file", "contains another archive", "unpack it")
            return read_sheets(inner)
        except InputError as error:
            raise error.at(path, f"{inner.name}, {error.field}") from None


_UNPACK: dict[str, type[gzip.GzipFile | bz2.BZ2File | lzma.LZMAFile]] = {
    ".gz": gzip.GzipFile,
    ".bz2": bz2.BZ2File,
    ".xz": lzma.LZMAFile,
}
READERS: dict[str, Reader] = {
    # LabVIEW's own heading may have been left out, or taken off.
    **dict.fromkeys((".csv", ".txt", ".dat", ".tra", ".asc", ".tsv", ".tab", ".lvm", ".itx", ".ddf"), read_text),
    **dict.fromkeys((".xlsx", ".xlsm"), _workbook),
    ".xls": _old_workbook,
    ".ods": _open_document,
    ".tdms": _tdms,
    ".mat": _matlab,
    **dict.fromkeys((".h5", ".hdf5"), _hdf5),
    ".zip": _zipped,
    **dict.fromkeys(_UNPACK, _packed),
}
_BEGIN: dict[bytes, Reader] = {
    b"\x89HDF": _hdf5,
    b"TDSm": _tdms,
    **dict.fromkeys((b"\xd0\xcf\x11\xe0", b"\t\x00\x04\x00", b"\t\x02\x06\x00", b"\t\x04\x06\x00"), _old_workbook),
    b"MATLAB": _matlab,
    b"LabVIEW Measurement": _lvm,
    b"PK\x03\x04": _zipped,
}
"""By what a file begins with."""
_WORKBOOKS = (".xlsx", ".xlsm", ".xls", ".ods")


def recording_files(folder: Path) -> list[Path]:
    """Return the files in a folder that may be recordings, in order; not what systems leave beside them."""
    return sorted(f for f in folder.glob("*") if may_be_recording(f) and not is_litter(f))


def may_be_recording(path: Path) -> bool:
    """Tell whether a file is of a kind that instruments write."""
    return path.suffix.lower() in READERS or (path.is_file() and is_trios(path))


def is_litter(path: Path) -> bool:
    """Tell whether a system left a file beside others: a double of macOS, a hidden one, an open workbook's lock."""
    left = path.name.lower() in ("desktop.ini", "thumbs.db")
    return left or path.name.startswith((".", "~$")) or "__MACOSX" in path.parts


def read_sheets(path: Path) -> list[Sheet]:
    """Read all tables of an instrument's file, or the one that a path names in it (`file_of`).

    Raises
    ------
    InputError
        If the file is missing, too large, of no known kind, damaged, a microscope's, or holds no table of numbers.
    """
    file = file_of(path)
    if not file.is_file():
        raise _no_file(path)
    if file == path:
        _read_sheets.cache_clear()
    stamp = file.stat()
    sheets = _read_sheets(file, stamp.st_size, stamp.st_mtime_ns)
    return [one for one in sheets if file == path or PurePath(one.name) == path.relative_to(file)]


@lru_cache(maxsize=1)
def _read_sheets(path: Path, size: int, changed: int) -> tuple[Sheet, ...]:
    """Read a file's tables, once for all of its trials."""
    ending, refused = path.suffix.lower(), partial(InputError, path, "file")
    if size == 0:
        raise refused("is empty", "copy or export it again")
    check_size(path, size)
    refuse_force_curve(path)
    refuse_what_holds_no_table(path)
    with path.open("rb") as file:
        begin = file.read(32)
    reader = next((reader for mark, reader in _BEGIN.items() if begin.startswith(mark)), None)
    reader = _trios if is_trios(path) else reader
    # Many programs call text a workbook's name.
    text = ending in _WORKBOOKS and b"\0" not in begin
    reader = reader or (read_text if text else READERS.get(ending))
    try:
        sheets = (reader or read_text)(path)
    except ModuleNotFoundError:
        raise
    except (InputError, MemoryError):
        if reader is None and ending:
            raise _no_kind(path) from None
        raise
    except Exception as error:  # a damaged file: its library raises whatever it meets
        said = " ".join(str(error).split())[:120] or type(error).__name__
        remedy = "it may be damaged, or of another kind than its name says: copy or export it again"
        raise refused(f"can't be read as {ending or 'what it begins as'} ({said})", remedy) from error
    if not sheets:
        problem = "contains no columns of numbers with names"
        raise refused(problem, "export time, displacement and force, each with its name")
    return tuple(sheets)


def _no_file(path: Path) -> InputError:
    if path.is_dir():
        return InputError(path, "file", "is a folder", "give a file in it")
    if path.is_symlink() and not path.exists():
        return InputError(path, "file", "is a link to a file that isn't there", "copy the file itself")
    if path.exists():
        return InputError(path, "file", "is a device or a pipe", "write what comes from it into a file")
    if path.suffix and path.suffix.lower() not in READERS:
        return _no_kind(path)
    return InputError(path, "file", "not found", "check the path")


def _no_kind(path: Path) -> InputError:
    kinds = f"export it as one of {', '.join(READERS)}"
    return InputError(path, "file", f"'{path.suffix}' is not a kind of file that legfem reads", kinds)

"""Instruments' files: which reader reads what."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from legfem.common.errors import InputError
from legfem.recording.formats.arrays import read_hdf5, read_matlab
from legfem.recording.formats.labview import read_lvm, read_tdms
from legfem.recording.formats.sheet import Column, Sheet
from legfem.recording.formats.text import read_text
from legfem.recording.formats.workbook import read_workbook

__all__ = ["READERS", "Column", "Sheet", "read_sheets"]

READERS: dict[str, Callable[[Path], list[Sheet]]] = {
    **dict.fromkeys((".csv", ".txt", ".dat", ".tra", ".asc", ".tsv"), read_text),
    **dict.fromkeys((".xlsx", ".xlsm"), read_workbook),
    ".tdms": read_tdms,
    ".lvm": read_lvm,
    ".mat": read_matlab,
    **dict.fromkeys((".h5", ".hdf5"), read_hdf5),
}


def read_sheets(path: Path) -> list[Sheet]:
    """Read all tables of an instrument's file.

    Raises
    ------
    InputError
        If the file is missing, of no known kind, damaged, or holds no table of numbers.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(
            path, "file", f"'{path.suffix}' is no kind that is read",
            f"export it as one of {', '.join(READERS)}",
        )  # fmt: skip
    if not path.is_file():
        raise InputError(path, "file", "not found", "check the path")
    if path.stat().st_size == 0:
        raise InputError(path, "file", "is empty", "copy or export it again")
    try:
        sheets = reader(path)
    except (InputError, MemoryError):
        raise
    except Exception as error:  # a damaged file: its library raises whatever it meets
        said = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(
            path, "file", f"can't be read as {path.suffix.lower()} ({said})",
            "it is damaged or of another kind: copy or export it again",
        ) from error  # fmt: skip
    if not sheets:
        raise InputError(
            path,
            "file",
            "holds no columns of numbers with names",
            "export time, displacement and force, each with its name",
        )
    return sheets

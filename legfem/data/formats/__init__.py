"""Instruments' files: which reader reads what."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from legfem.common.errors import InputError
from legfem.data.formats.sheet import Column, Sheet
from legfem.data.formats.text import read_text

__all__ = ["READERS", "Column", "Sheet", "read_sheets"]


# The libraries of kinds that a command doesn't read take a good part of its start.
def _workbook(path: Path) -> list[Sheet]:
    from legfem.data.formats.workbook import read_workbook

    return read_workbook(path)


def _tdms(path: Path) -> list[Sheet]:
    from legfem.data.formats.labview import read_tdms

    return read_tdms(path)


def _lvm(path: Path) -> list[Sheet]:
    from legfem.data.formats.labview import read_lvm

    return read_lvm(path)


def _matlab(path: Path) -> list[Sheet]:
    from legfem.data.formats.arrays import read_matlab

    return read_matlab(path)


def _hdf5(path: Path) -> list[Sheet]:
    from legfem.data.formats.arrays import read_hdf5

    return read_hdf5(path)


READERS: dict[str, Callable[[Path], list[Sheet]]] = {
    **dict.fromkeys((".csv", ".txt", ".dat", ".tra", ".asc", ".tsv"), read_text),
    **dict.fromkeys((".xlsx", ".xlsm"), _workbook),
    ".tdms": _tdms,
    ".lvm": _lvm,
    ".mat": _matlab,
    **dict.fromkeys((".h5", ".hdf5"), _hdf5),
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
            path, "file", f"'{path.suffix}' is no kind that is read", f"export it as one of {', '.join(READERS)}"
        )
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
            path,
            "file",
            f"can't be read as {path.suffix.lower()} ({said})",
            "it is damaged or of another kind: copy or export it again",
        ) from error
    if not sheets:
        raise InputError(
            path,
            "file",
            "holds no columns of numbers with names",
            "export time, displacement and force, each with its name",
        )
    return sheets

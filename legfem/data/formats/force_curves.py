"""Force curves of atomic force microscopes, told by what their programs write: they are named, and never read.

A curve has a piezo's height and a lever's deflection, often without a clock, and its tip has a radius of nanometres:
none of legfem's tests. Read by its columns' names alone it would pass for one.
"""

import re
import zipfile
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

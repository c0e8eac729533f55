"""The schema of what a folder's file says a leg's shape is taken from."""

from collections.abc import Iterator
from pathlib import Path
from typing import ClassVar

from legfem.common.errors import InputError, remedy_for_missing
from legfem.common.input_files import FileTable, Text, Trouble

type Labels = int | list[int]


class ShapeEntry(FileTable):
    """A leg's shape: one of a label volume, contours, or closed surfaces."""

    scan: Text | None = None
    """Label volume in the folder: NIfTI, NRRD or DICOM-SEG."""
    series: Text | None = None
    """Folder of the DICOM series that a scan was labelled on, where its file doesn't say where it lies."""
    contours: Text | None = None
    """CSV file of the outlines of skin, fascia and bones."""
    surfaces: dict[str, Text | list[Text]] | None = None

    sources: ClassVar[dict[str, str]] = {
        "scan": "scan (label volume)",
        "contours": "contours (CSV)",
        "surfaces": "surfaces (STL files by part)",
    }
    """Keys of which one says what the shape is taken from, in words."""

    def troubles(self) -> Iterator[Trouble]:
        """Yield other than one source, and a series without its scan."""
        given = [name for name in self.sources if getattr(self, name)]
        if len(given) != 1:
            *others, last = self.sources.values()
            problem = f"{len(given)} sources of the leg's shape are given"
            yield "scan", problem, f"give one of {', '.join(others)} and {last}"
        if self.series is not None and self.scan is None:
            yield "series", "is given without a scan", "give the scan, or leave it out"


def existing(directory: Path, name: str, toml: Path, field: str) -> Path:
    """Return the path of a file that a folder's file names.

    Raises
    ------
    InputError
        If there is none.
    """
    found = directory / name
    try:
        there = found.exists()
    except OSError as error:
        raise InputError(toml, field, f"can't be a file ({error.strerror})", "name it") from None
    if not there:
        raise InputError(toml, field, f"there is no file '{name}'", remedy_for_missing(found, f"put it at {found}"))
    return found

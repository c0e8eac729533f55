"""What commands share that take a folder of specimens in a leg's place."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from legfem.common.command_line import check_out_folder
from legfem.common.doubts import log_doubts
from legfem.common.errors import InputError

if TYPE_CHECKING:
    from legfem.specimens.folder import SpecimenFolder


def specimens_for(
    command: str, directory: Path, out: Path | None, legs_alone: Mapping[str, object]
) -> tuple[SpecimenFolder, Path]:
    """Return the folder of specimens and that for results, both checked.

    Parameters
    ----------
    command : str
        Which one, for the name of the default folder.
    directory : Path
        With specimens.
    out : Path, optional
        For results; ``results/COMMAND-ID`` without it.
    legs_alone : Mapping[str, object]
        What was given by options that are for legs; None where nothing was.

    Raises
    ------
    InputError
        If any of them was given, or anything in the folder is missing or wrong.
    """
    from legfem.specimens.folder import load_specimen

    for option, given in legs_alone.items():
        if given is not None:
            raise InputError(option, "--specimen-dir", "is given too", "leave one out")
    found = load_specimen(directory)
    log_doubts(found.doubts)
    folder = out or Path("results") / f"{command}-{found.id}"
    check_out_folder(folder)
    return found, folder

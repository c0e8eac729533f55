"""Options that commands share, and what they print at their end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from legfem.common.command_line import check_out_folder
from legfem.common.doubts import log_doubts
from legfem.common.errors import InputError

if TYPE_CHECKING:
    from legfem.specimens.folder import SpecimenFolder

Subject = Annotated[str | None, typer.Option(help="Id of a subject that comes with legfem.")]
SubjectDir = Annotated[Path | None, typer.Option(help="Folder of a subject of your own, instead.")]
Site = Annotated[str | None, typer.Option(help="Of a leg with several [[site]] the one to take.", show_default=False)]
SpecimenDir = Annotated[Path | None, typer.Option(help="Folder of specimens in a lab's test, in place of a leg.")]
Jobs = Annotated[int | None, typer.Option(help="Processes; all cores by default.")]


def print_outcome(texts: Sequence[str], result: Path, report: Path, quiet: bool, as_json: bool) -> None:
    """Print what was found and where it lies.

    Parameters
    ----------
    texts
        For people.
    result
        The JSON document.
    report
        ``report.txt``; the page, if there is one, stands beside it.
    quiet, as_json
        Options of the command.
    """
    from legfem.report.page import PAGE

    if as_json:
        print(result.read_text(encoding="utf-8"), end="")
        return
    for text in () if quiet else texts:
        print(text)
    print(f"result: {result}\nreport: {report}")
    if (page := report.with_name(PAGE)).exists():
        print(f"page:   {page}")


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

"""Options that commands share, and what they print at their end."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    pass

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

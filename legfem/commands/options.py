"""Options that commands share, what they name, and what is printed at the end."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from legfem.api.results import Result

Subject = Annotated[str | None, typer.Option(help="Id of one of legfem's own subjects.")]
SubjectDir = Annotated[Path | None, typer.Option(help="Folder of your own subject, in place of --subject.")]
Site = Annotated[str | None, typer.Option(help="Site to use, if the leg has several [[site]].", show_default=False)]
SpecimenDir = Annotated[Path | None, typer.Option(help="Folder of specimens in a lab's test, in place of a leg.")]
Jobs = Annotated[int | None, typer.Option(help="Processes; all cores by default.")]


def passed(context: typer.Context, *names: str) -> dict[str, Any]:
    """Return the options that the front door's function takes by the same names; it has the defaults of the others."""
    return {name: given for name in names if (given := context.params[name]) not in (None, [], ())}


def finish(found: "Result", folder: Path, numbers: str, quiet: bool, as_json: bool, text: str | None = None) -> None:
    """Write what was found, and print it and where it lies.

    Parameters
    ----------
    found
        A result of the front door.
    folder
        For results.
    numbers
        Name of the JSON document in it.
    quiet, as_json
        Options of the command.
    text
        For people; all of ``report.txt`` without it.
    """
    report = found.write(folder)
    print_outcome(text or report.read_text(encoding="utf-8"), folder / numbers, report, quiet, as_json)


def print_outcome(text: str, result: Path, report: Path, quiet: bool, as_json: bool) -> None:
    """Print a text for people unless quiet, and the paths; or the JSON document alone."""
    from legfem.report.page import PAGE

    if as_json:
        print(result.read_text(encoding="utf-8"), end="")
        return
    if not quiet:
        print(text)
    print(f"result: {result}\nreport: {report}")
    if (page := report.with_name(PAGE)).exists():
        print(f"page:   {page}")

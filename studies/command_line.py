"""What the studies' commands share: their options, and what they write and print at their end."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from legfem.common.documents import json_types, write_atomically, write_document

Jobs = Annotated[int | None, typer.Option(min=1, help="Processes; all cores by default.")]
Out = Annotated[Path | None, typer.Option(help="Folder for results; results/STUDY by default.")]
Library = Annotated[Path | None, typer.Option(help="Folder of responses; ~/.cache/legfem/responses by default.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of all draws.")]

DONE_IS_KEPT = "run the same command again to go on; what is done is kept"
"""How a study goes on after it was interrupted."""


def new_app() -> typer.Typer:
    """Make a study's command."""
    return typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


def write_results(folder: Path, document: Mapping[str, Any], page: str) -> None:
    """Write ``result.json`` and ``report.md``, and print the latter.

    Parameters
    ----------
    document
        Numbers of simulated data, beside the schema and the origin.
    page
        Tables and sentences in Markdown.
    """
    write_document(folder / "result.json", json_types({"schema": 1, "origin": "simulated", **document}))
    write_atomically(folder / "report.md", page)
    typer.echo(page)
    typer.echo(f"report: {folder / 'report.md'}")

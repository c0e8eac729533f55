"""``--quiet`` and ``--json`` of every command."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, redirect_stdout
from pathlib import Path
from typing import Annotated

import typer

Quiet = Annotated[bool, typer.Option("--quiet", help="No progress; print only where the results are.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result's JSON, and nothing else, to stdout.")]


@contextmanager
def told_briefly(quiet: bool, as_json: bool) -> Iterator[list[Path]]:
    """Keep to itself what is printed, where that was asked for; print what is listed at the end.

    Yields a list for the paths of the JSON documents that were written. Nothing is printed of work
    that ends with an exception.
    """
    written: list[Path] = []
    with redirect_stdout(io.StringIO()) if quiet or as_json else nullcontext():
        yield written
    for path in written if quiet or as_json else ():
        print(path.read_text(encoding="utf-8").rstrip() if as_json else f"result: {path}")

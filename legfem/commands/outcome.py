"""What a command prints at its end."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from legfem.report.web.page import PAGE


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
    if as_json:
        print(result.read_text(encoding="utf-8"), end="")
        return
    for text in () if quiet else texts:
        print(text)
    print(f"result: {result}\nreport: {report}")
    if (page := report.with_name(PAGE)).exists():
        print(f"page:   {page}")

"""The files of a report, and what each shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from legfem.report.render.text import fill

NUMBERS = "all numbers with their units"


@dataclass(frozen=True)
class ReportFile:
    """A file of a report, or several of one kind, and what it shows."""

    paths: Sequence[Path]
    shows: str


RESULT = ReportFile([Path("result.json")], NUMBERS)


def listing(files: Sequence[ReportFile]) -> str:
    """Return a report's files and what each shows."""
    return "\n".join(f"{', '.join(path.name for path in entry.paths)}\n{fill(entry.shows, ' ' * 4)}" for entry in files)

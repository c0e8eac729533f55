"""Files of a report: there together, the page last, or not at all."""

import json
import shlex
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from legfem.common.documents import write_document
from legfem.common.errors import naming

if TYPE_CHECKING:
    from mpi4py import MPI

REPORT = "report.txt"
_UNFINISHED = ".report-unfinished"


@contextmanager
def made_in_place(out: Path, comm: "MPI.Intracomm | None" = None) -> Iterator[Path]:
    """Yield a hidden folder, from which files are moved into place at the end, the report last.

    Whoever stops the run in between finds no half-written file.

    Parameters
    ----------
    out
        Where the files are to be; made if missing.
    comm
        Of the ranks that write to the folder, all of which call; this process alone without it.
    """
    hidden = out / _UNFINISHED
    first = comm is None or comm.rank == 0
    if first:
        shutil.rmtree(hidden, ignore_errors=True)
        hidden.mkdir(parents=True)
    if comm is not None:
        comm.barrier()
    try:
        with naming(out):
            yield hidden
            if first:
                made = sorted(hidden.iterdir(), key=lambda path: path.name == REPORT)
                if before := _made_by(out):
                    names = {*before["files"], *(path.name for path in made)}
                    write_document(out / _MADE_BY, before | {"files": sorted(names)})
                for path in made:
                    target = out / path.name
                    if target.is_dir():
                        shutil.rmtree(target)
                    path.replace(target)
    finally:
        if first:
            shutil.rmtree(hidden, ignore_errors=True)
    if comm is not None:
        comm.barrier()


_WITHOUT_EFFECT = {"--quiet": 1, "--json": 1, "--jobs": 2, "--out": 2}
"""Options that change no result, and how many words each takes."""


_MADE_BY = ".made-by.json"
"""In a folder of results: the command that made them, and the files that it wrote."""


def keep_another(out: Path, command: str, *documents: str) -> None:
    """Move the files that another command (of another law or depth) wrote aside, and keep what this one is.

    They go to a folder ``earlier-1`` within, and a line says so. To be called before anything of the new one is
    written.

    Parameters
    ----------
    out
        Folder of results; made if missing.
    command
        That was given now; empty where there was none, and nothing is moved.
    documents
        Names of files that will be written beside those of `made_in_place`.
    """
    before, now = _made_by(out), _words(command)
    earlier = before.get("command", [])
    if earlier and now and earlier != now:
        number = 1
        while (aside := out / f"earlier-{number}").exists():
            number += 1
        aside.mkdir()
        for name in before["files"]:
            if (out / name).exists():
                (out / name).replace(aside / name)
        print(f"{out} held the results of another command ({' '.join(earlier)}): they are in {aside}", file=sys.stderr)
    (out / _MADE_BY).unlink(missing_ok=True)
    if now:
        write_document(out / _MADE_BY, {"command": now, "files": list(documents)})


def _made_by(out: Path) -> dict[str, list[str]]:
    """Return the command and the names of files that a folder's results are of; nothing where that isn't known."""
    try:
        found = json.loads((out / _MADE_BY).read_text(encoding="utf-8"))
        return {"command": [str(word) for word in found["command"]], "files": [Path(n).name for n in found["files"]]}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


def _words(command: str) -> list[str]:
    """Return a command's words without those that change no result; none of what is no command of legfem's."""
    words = shlex.split(command) if command.startswith(("legfem ", "python -m legfem")) else []
    kept: list[str] = []
    while words:
        taken = _WITHOUT_EFFECT.get(words[0], 0)
        kept += [] if taken else words[:1]
        words = words[taken or 1 :]
    return kept


NUMBERS = "all numbers with their units"


@dataclass(frozen=True)
class ReportFile:
    """A file of a report, or several of one kind, and what it shows."""

    paths: Sequence[Path]
    shows: str


RESULT = ReportFile([Path("result.json")], NUMBERS)

"""Files of a report: there together, the page last, or not at all."""

from __future__ import annotations

import re
import shlex
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from mpi4py import MPI

from legfem.common.errors import naming

REPORT = "report.txt"
_UNFINISHED = ".report-unfinished"


@contextmanager
def made_in_place(out: Path, comm: MPI.Intracomm = MPI.COMM_SELF) -> Iterator[Path]:
    """Yield a hidden folder, from which files are moved into place at the end, the report last.

    Whoever stops the run in between finds no half-written file.

    Parameters
    ----------
    out
        Where the files are to be; made if missing.
    comm
        Of the ranks that write to the folder; all of them call.
    """
    hidden = out / _UNFINISHED
    if comm.rank == 0:
        shutil.rmtree(hidden, ignore_errors=True)
        hidden.mkdir(parents=True)
    comm.barrier()
    try:
        with naming(out):
            yield hidden
            if comm.rank == 0:
                for path in sorted(hidden.iterdir(), key=lambda path: path.name == REPORT):
                    target = out / path.name
                    if target.is_dir():
                        shutil.rmtree(target)
                    path.replace(target)
    finally:
        if comm.rank == 0:
            shutil.rmtree(hidden, ignore_errors=True)
    comm.barrier()


_COMMAND = re.compile(r"^How to repeat it\n-+\n(.*)", re.MULTILINE)
_LIST = re.compile(r"^Files\n-+\n(.*)", re.MULTILINE | re.DOTALL)
_WITHOUT_EFFECT = {"--quiet": 1, "--json": 1, "--jobs": 2, "--out": 2}
"""Options that change no result, and how many words each takes."""


def keep_another(out: Path, command: str) -> None:
    """Move a report that another command (of another law or depth) wrote aside, with all files that it lists.

    It goes to a folder ``earlier-1`` within, and a line says so. To be called before anything of the new one is
    written.

    Parameters
    ----------
    out
        Folder of results.
    command
        That was given now; empty where there was none, and nothing is moved.
    """
    try:
        before = (out / REPORT).read_text(encoding="utf-8")
    except OSError:
        return
    found = _COMMAND.search(before)
    earlier, now = _words(found[1] if found else ""), _words(command)
    if not earlier or not now or earlier == now:
        return
    number = 1
    while (aside := out / f"earlier-{number}").exists():
        number += 1
    aside.mkdir()
    listed = _LIST.search(before)
    lines = listed[1].splitlines() if listed else []
    names = [name for line in lines if line[:1].strip() for name in line.split(", ")]
    for name in (*names, REPORT):
        if (out / name).exists():
            (out / name).replace(aside / name)
    print(f"{out} held the results of another command ({' '.join(earlier)}): they are in {aside}", file=sys.stderr)


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

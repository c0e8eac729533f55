"""Files of a report: there together, the page last, or not at all."""

from __future__ import annotations

import shutil
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


NUMBERS = "all numbers with their units"


@dataclass(frozen=True)
class ReportFile:
    """A file of a report, or several of one kind, and what it shows."""

    paths: Sequence[Path]
    shows: str


RESULT = ReportFile([Path("result.json")], NUMBERS)

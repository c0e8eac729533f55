"""States of a long solution on disk, from which it goes on where it was killed.

Every rank writes its own part, so that a solution goes on with as many ranks as it was begun with.
A part has the step's number in its name, and the first rank names the last step of which all parts
are there: neither a kill nor another solution's files are ever taken for a state.
"""

import io
import json
import time
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from legfem.common.documents import write_document
from legfem.common.errors import naming
from legfem.jobs.store import key_of

type Arrays = dict[str, NDArray[Any]]


def write_arrays(path: Path, arrays: Mapping[str, NDArray[Any]], compressed: bool = False) -> None:
    """Write arrays by name (``.npz``); a reader never meets half of them."""
    content = io.BytesIO()
    save = np.savez_compressed if compressed else np.savez
    save(content, **arrays)  # type: ignore[arg-type]
    new = path.with_suffix(".new")
    try:
        with naming(path):
            new.write_bytes(content.getvalue())
            new.replace(path)
    except OSError:
        new.unlink(missing_ok=True)
        raise


def read_arrays(path: Path) -> Arrays:
    """Return a file's arrays; none where it is missing or malformed."""
    try:
        with np.load(path) as kept:
            return dict(kept)
    except (OSError, ValueError, LookupError, TypeError, EOFError, BadZipFile, zlib.error):
        return {}


@dataclass
class Checkpoint:
    """A folder for the states of one solution.

    Parameters
    ----------
    folder
        Made where it is missing; `clear` empties it.
    key
        Hash of the solution's inputs; states of another one are passed over.
    comm
        Ranks that the solution is spread over.
    seconds
        Least time between states, s.
    """

    folder: Path
    key: str
    comm: MPI.Intracomm
    seconds: float = 120.0
    _last: float = field(default_factory=time.monotonic)
    _number: int = 0

    @property
    def due(self) -> bool:
        """Whether it is time for a state; the same on all ranks."""
        return bool(self.comm.bcast(time.monotonic() - self._last >= self.seconds, root=0))

    def save(self, arrays: Arrays, plain: Mapping[str, Any]) -> None:
        """Write a state, the rank's arrays and what is the same on all ranks; collective."""
        before, self._number = self._number, self._number + 1
        self.folder.mkdir(parents=True, exist_ok=True)
        write_arrays(self._part(self._number), arrays)
        self.comm.Barrier()
        if self.comm.rank == 0:
            head = {"key": self.key, "ranks": self.comm.size, "number": self._number}
            write_document(self._head, {**head, "digest": key_of(plain), "plain": plain})
        self.comm.Barrier()
        self._part(before).unlink(missing_ok=True)
        self._last = time.monotonic()

    def load(self, shapes: Mapping[str, tuple[int, ...]]) -> tuple[Arrays, dict[str, Any]] | None:
        """Return the last state whose arrays have the given shapes, if there is one; collective."""
        head = self.comm.bcast(self._read_head() if self.comm.rank == 0 else None, root=0)
        if head is None:
            return None
        number, plain = head
        arrays = read_arrays(self._part(number))
        fits = all(name in arrays and arrays[name].shape == s for name, s in shapes.items())
        if not self.comm.allreduce(fits, MPI.LAND):
            return None
        self._number = number
        return arrays, plain

    def _read_head(self) -> tuple[int, dict[str, Any]] | None:
        """Return number and plain values of the last state; None without a whole one of the key."""
        try:
            head = json.loads(self._head.read_text(encoding="utf-8"))
            if (head["key"], head["ranks"]) != (self.key, self.comm.size):
                return None
            plain = dict(head["plain"])
            return (int(head["number"]), plain) if head["digest"] == key_of(plain) else None
        except (OSError, ValueError, LookupError, TypeError, RecursionError):
            return None

    def clear(self) -> None:
        """Remove the states: the solution is known; collective."""
        self.comm.Barrier()
        if self.comm.rank == 0 and self.folder.is_dir():
            for file in self.folder.iterdir():
                file.unlink()
            self.folder.rmdir()
        self.comm.Barrier()

    @property
    def _head(self) -> Path:
        return self.folder / "last.json"

    def _part(self, number: int) -> Path:
        return self.folder / f"{number:05d}-{self.comm.rank}.npz"

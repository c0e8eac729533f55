"""Finished work on disk, each piece as soon as it is done: a rerun does only what isn't there yet."""

import json
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from pydantic import TypeAdapter

from legfem.common.documents import write_atomically
from legfem.common.progress import Progress
from legfem.jobs.key import code_fingerprint, key_of
from legfem.jobs.pool import Workers


class Store[Kept]:
    """A folder of finished work, one JSON file each, under a key of all that it depends on.

    What is kept comes back to the last bit, NaN and infinity too. A file that is cut short, or that
    belongs to other inputs, settings, code or versions of DOLFINx, PETSc or gmsh, counts as absent.

    Parameters
    ----------
    folder : Path
        Made when the first piece is kept.
    kind : type
        Type of a finished piece: a dataclass, or a type of lists, mappings and numbers.
    depends_on : object
        What all pieces depend on; see `key_of`.
    modules : sequence of str
        The modules that compute a piece; they count with all of legfem that they import.
    named : callable, optional
        Returns a piece's file name, without ending, from what is asked for; the key by default.
        A named file is overwritten once its key is another.
    """

    def __init__(
        self,
        folder: Path,
        kind: type[Kept],
        depends_on: object = None,
        modules: Sequence[str] = (),
        named: Callable[[Any], str] | None = None,
    ) -> None:
        self.folder, self.named = folder, named
        self.kind: Any = kind
        self._common = key_of(depends_on, code_fingerprint(*modules))

    def key(self, asked: object) -> str:
        """Return the key of a piece of work, done or not."""
        return key_of(self._common, asked)

    def path(self, asked: object) -> Path:
        """Return the file of a piece of work, there or not."""
        return self.folder / f"{self.named(asked) if self.named else self.key(asked)}.json"

    def get(self, asked: object) -> Kept | None:
        """Return a finished piece; None if there is none that can be read."""
        try:
            document = json.loads(self.path(asked).read_text(encoding="utf-8"))
            if document["key"] != self.key(asked):
                return None
            kept: Kept = _adapter(self.kind).validate_python(document["kept"])
        except (OSError, ValueError, LookupError, TypeError, RecursionError):
            return None
        return kept

    def put(self, asked: object, kept: Kept) -> None:
        """Write a finished piece; it is there whole or not at all."""
        self.folder.mkdir(parents=True, exist_ok=True)
        document = {"key": self.key(asked), "kept": _adapter(self.kind).dump_python(kept)}
        write_atomically(self.path(asked), json.dumps(document, default=np.generic.item))

    def get_or_make(
        self,
        asked: object,
        make: Callable[[], Kept],
        comm: MPI.Intracomm = MPI.COMM_SELF,
        worth: Callable[[Kept], bool] = lambda kept: True,
    ) -> Kept:
        """Return a finished piece; if it is absent, make it, and keep it if it is worth that.

        Collective over the communicator, whose first rank alone reads and writes.
        """
        kept = comm.bcast(self.get(asked) if comm.rank == 0 else None)
        if kept is None:
            kept = make()
            if comm.rank == 0 and worth(kept):
                self.put(asked, kept)
        return kept


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def finish[Context, Task, Outcome](
    workers: Workers[Context, Task, Outcome],
    tasks: Sequence[Task],
    store: Store[Outcome],
    progress: Progress,
    stage: str,
    line: Callable[[Task, Outcome], str],
    asked: Callable[[Task], object] = lambda task: task,
    worth: Callable[[Outcome], bool] = lambda outcome: True,
    on_found: Callable[[dict[int, Outcome]], None] = lambda found: None,
) -> list[Outcome]:
    """Return the outcomes of all tasks, in their order, each kept as soon as it is known.

    Parameters
    ----------
    workers, tasks
        Tasks, and the processes for those without an outcome in the store.
    store
        Where outcomes are kept.
    progress
        Where the stage and every new outcome are reported.
    stage, line
        Text of the stage, and function from a task and its outcome to a line of progress.
    asked
        Function from a task to what the store knows it by.
    worth
        Tells whether to keep an outcome; others are tried again the next time.
    on_found
        Called with all outcomes so far, by place in the list, whenever there is a new one.
    """
    kept = ((place, store.get(asked(task))) for place, task in enumerate(tasks))
    found = {place: outcome for place, outcome in kept if outcome is not None}
    waiting = [place for place in range(len(tasks)) if place not in found]
    known = f" ({len(found)} known)" if found else ""
    progress.stage(stage + known, len(waiting))
    todo = [tasks[place] for place in waiting]
    for number, outcome in workers.places(todo) if todo else ():
        if worth(outcome):
            store.put(asked(todo[number]), outcome)
        found[waiting[number]] = outcome
        progress.advance(line(todo[number], outcome))
        on_found(found)
    return [found[place] for place in range(len(tasks))]

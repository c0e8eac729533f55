"""Files that an instrument writes into a folder: what is to be seen of each at a look, as values.

A file is complete once it has stood still for a while and can be read. One that stands still for longer and can't be
is stalled: the instrument may have stopped, or writes what legfem doesn't read.
"""

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from legfem.common.errors import InputError
from legfem.data.formats import READERS
from legfem.data.formats.sheet import file_of
from legfem.data.formats.text import read_text

SETTLED_S, STALLED_S = 2.0, 10.0
"""That a file stands still before it is taken for complete, and before it is said that it can't be read."""

type Stamp = tuple[int, int]
"""Size in bytes, and time of the last change in ns."""
type Watched = Mapping[Path, WatchedFile]
type FileState = Literal["appeared", "growing", "complete", "stalled", "replaced", "gone"]
"""What a file is at a look; it is replaced where it was complete, and is written again."""


@dataclass(frozen=True)
class WatchedFile:
    """A file at a look."""

    state: FileState
    stamp: Stamp
    since: float
    """Time (s) at which it was first seen like that."""
    trouble: str = ""
    """Why it can't be read, of one that stalled."""

    @property
    def open(self) -> bool:
        """Whether it may be being written."""
        return self.state in ("appeared", "growing", "replaced")


def stamps_of(files: Iterable[Path]) -> dict[Path, Stamp]:
    """Return the stamps of the files that are there."""
    found = {}
    for path in files:
        with suppress(FileNotFoundError):
            seen = file_of(path).stat()
            found[path] = seen.st_size, seen.st_mtime_ns
    return found


def is_cut(path: Path) -> bool:
    """Tell whether a text file ends within a row: one that has no end, and fewer cells than the row before."""
    if READERS.get(path.suffix.lower()) is not read_text:
        return False
    before, last = [b"", b"", *path.read_bytes()[-_LAST_BYTES:].splitlines(keepends=True)][-2:]
    cells = (last.count(mark) < before.count(mark) for mark in (b",", b";", b"\t"))
    return not last.endswith((b"\r", b"\n")) and any(cells)


_LAST_BYTES = 4000
"""That hold a file's last two rows."""


def looked(before: Watched, there: Mapping[Path, Stamp], now: float, read: Callable[[Path], object]) -> Watched:
    """Return what the files are now; one that is gone is told of once.

    Parameters
    ----------
    before
        What they were at the last look.
    there
        Their stamps.
    now
        Time, s.
    read
        Reads a file, or raises an InputError or OSError.
    """
    left = {path: was for path, was in before.items() if path not in there and was.state != "gone"}
    gone = {path: replace(was, state="gone", since=now) for path, was in left.items()}
    return {path: _seen(path, stamp, before.get(path), now, read) for path, stamp in there.items()} | gone


def _seen(path: Path, stamp: Stamp, was: WatchedFile | None, now: float, read: Callable[[Path], object]) -> WatchedFile:
    if was is None or was.state == "gone":
        return WatchedFile("appeared", stamp, now)
    if stamp != was.stamp:
        return WatchedFile("replaced" if was.state in ("complete", "replaced") else "growing", stamp, now)
    if not was.open or now - was.since < SETTLED_S:
        return was
    try:
        read(path)
    except (InputError, OSError) as error:
        stalled = now - was.since >= STALLED_S
        return replace(was, state="stalled", trouble=str(error)) if stalled else was
    return replace(was, state="complete")


def changes(before: Watched, now: Watched) -> dict[Path, FileState]:
    """Return the new states of the files that are in another one than at the last look."""
    return {path: one.state for path, one in now.items() if path not in before or before[path].state != one.state}

"""The errors a user meets: what was given can't be used, or nothing of it could be solved."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike


class InputError(Exception):
    """Something a user gave is wrong.

    Commands catch it, print its single line and exit with status 2.

    Parameters
    ----------
    source : str or PathLike
        File (or command-line option) at fault.
    field : str
        Key, column, part or row at fault.
    problem : str
        What is wrong.
    remedy : str
        What the user can do about it.
    """

    def __init__(self, source: str | PathLike[str], field: str, problem: str, remedy: str) -> None:
        self.source = str(source)
        self.field = field
        self.problem = problem
        self.remedy = remedy
        super().__init__(self.source, field, problem, remedy)

    def __str__(self) -> str:
        """Return ``file: field: what is wrong; remedy`` on one line."""
        line = f"{self.source}: {self.field}: {self.problem}; {self.remedy}"
        return "".join(c if c.isprintable() else "?" for c in " ".join(line.split()))


class UnsolvedError(Exception):
    """What all else rests on couldn't be solved.

    Commands catch it, print its message as one line and exit with status 1.
    """


@contextmanager
def naming(path: str | PathLike[str]) -> Iterator[None]:
    """Name a file or folder in an OSError that names none, as a full disk's."""
    try:
        yield
    except OSError as error:
        error.filename = error.filename or str(path)
        raise

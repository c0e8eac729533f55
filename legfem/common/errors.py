"""The one error a user meets when what was given cannot be used."""

from __future__ import annotations

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
        return " ".join(line.split())

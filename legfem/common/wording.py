"""What a person can set and start, named without saying how: each door (the command line, Python) words it.

The command's words stand here, since an error's line is the command's; `InputError.worded` asks another door.
"""

import shlex
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Argument:
    """What is given to a run: a command's option, a call's keyword.

    Parameters
    ----------
    name : str
        As a keyword: ``leave_out``.
    value : str, optional
        What to give; None leaves it open.
    """

    name: str
    value: str | None = None

    def __str__(self) -> str:
        """Return the command's option."""
        option = self.name.replace("_", "-")
        return f"--{option}" if self.value is None else f"--{option} {shlex.quote(self.value)}"


@dataclass(frozen=True)
class Command:
    """Something that a person can start.

    Parameters
    ----------
    name : str
        The command's: ``identify``, ``study correction``.
    arguments : tuple of Argument
        How.
    given : str, optional
        File or folder that it takes.
    """

    name: str
    arguments: tuple[Argument, ...] = ()
    given: str | None = None

    def __str__(self) -> str:
        """Return the command."""
        given = [] if self.given is None else [shlex.quote(self.given)]
        return " ".join(["legfem", self.name, *given, *map(str, self.arguments)])


type Door = Callable[[Argument | Command], str]
"""How a door names arguments and commands."""


class Remedy:
    """What to do, as a text that names arguments and commands.

    Parameters
    ----------
    *parts : str, Argument or Command
        The text, in order.
    """

    def __init__(self, *parts: str | Argument | Command) -> None:
        self.parts = parts

    def worded(self, door: Door) -> str:
        """Return the text in a door's words."""
        return "".join(part if isinstance(part, str) else door(part) for part in self.parts)

    def __str__(self) -> str:
        """Return the text in the command's words."""
        return self.worded(str)

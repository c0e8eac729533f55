"""The errors a user meets, and checks that raise them."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from numbers import Real
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


def missing_module(error: ModuleNotFoundError) -> str:
    """Return the line that says how to get a package that isn't installed; raises what is legfem's own fault.

    Raises
    ------
    ModuleNotFoundError
        The error itself, where the missing module is legfem's.
    """
    package = (error.name or "").partition(".")[0]
    if package in ("", "legfem", "studies"):
        raise error
    what = "DOLFINx, which solves the finite elements," if package in ("dolfinx", "ufl", "basix", "ffcx") else package
    return (
        f"{what} isn't installed for {sys.executable}: in a checkout, begin the command with scripts/in-env, which "
        "installs all that it needs; else see docs/install.md"
    )


@contextmanager
def naming(path: str | PathLike[str]) -> Iterator[None]:
    """Name a file or folder in an OSError that names none, as a full disk's."""
    try:
        yield
    except OSError as error:
        error.filename = error.filename or str(path)
        raise


def check_positive(owner: object, *names: str, zero_allowed: bool = False) -> None:
    """Check attributes of a parameter object; symbols of a discretised model pass.

    Raises
    ------
    InputError
        If one is a number that is negative, not finite, or zero where zero isn't allowed.
    """
    for name in names:
        value = getattr(owner, name)
        if not isinstance(value, Real):
            continue
        number = float(value)
        good = number >= 0 if zero_allowed else number > 0
        if not (good and math.isfinite(number)):
            bound = "zero or more" if zero_allowed else "more than zero"
            raise InputError(
                source=type(owner).__name__,
                field=name,
                problem=f"is {number:g}",
                remedy=f"give a finite value of {bound}",
            )
